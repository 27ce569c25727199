"""What a run folder holds: config, checkpoint, metrics as JSON lines, and a policy with its card.

The checkpoint has weights, optimizer and progress in one file, so that a killed run never mixes two of them.
Nothing is ever unpickled.
"""

import json
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor
from torch.optim import Optimizer

from agents.interface.output_files import whole_file
from agents.learned.policy_file import reason_of
from hybrid_env.checks import reject

CONFIG = "config.json"
CHECKPOINT = "checkpoint.safetensors"
METRICS = "metrics.jsonl"


def save_checkpoint(
    folder: Path, weights: Mapping[str, Tensor], optimizer: Optimizer, numbers: Mapping[str, float]
) -> None:
    """Write weights, optimizer and progress as one file."""
    tensors = {f"policy.{name}": value.contiguous() for name, value in weights.items()}
    for index, state in optimizer.state_dict()["state"].items():
        tensors |= {f"optimizer.{index}.{name}": value for name, value in state.items()}
    with whole_file(folder / CHECKPOINT) as part:
        save_file(tensors, part, metadata={name: repr(value) for name, value in numbers.items()})


def load_checkpoint(folder: Path, module: Any, optimizer: Optimizer) -> dict[str, float]:
    """Put a checkpoint into a module and its optimizer; returns the progress that was saved with it.

    Raises:
        ArgumentError: there is none, or a damaged one.
    """
    try:
        with safe_open(folder / CHECKPOINT, framework="pt") as file:
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
            numbers = {name: float(value) for name, value in file.metadata().items()}
        module.load_state_dict(
            {name.removeprefix("policy."): t for name, t in tensors.items() if name.startswith("policy.")}
        )
        state: dict[int, dict[str, Tensor]] = {}
        for name, value in tensors.items():
            if name.startswith("optimizer."):
                _, index, key = name.split(".")
                state.setdefault(int(index), {})[key] = value
        groups = optimizer.state_dict()["param_groups"]
        optimizer.load_state_dict({"state": state, "param_groups": groups})
        numbers["steps"] = int(numbers["steps"])
    except (
        OSError, AttributeError, KeyError, TypeError, ValueError, RuntimeError, SafetensorError,
    ) as error:  # fmt: skip
        allowed = f"a run folder with a whole {CHECKPOINT} ({reason_of(error)})"
        raise reject("resume", str(folder), allowed) from None
    return numbers


def read_config(folder: Path) -> dict[str, Any]:
    """The config of a run that is to go on.

    Raises:
        ArgumentError: there is none, or a damaged one.
    """
    try:
        config = json.loads((folder / CONFIG).read_text(encoding="utf-8"))
        return {name: config[name] for name in ("env", "options", "recipe", "steps", "seed")}
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise reject("resume", str(folder), f"a run folder with a readable {CONFIG} ({error})") from None


def append_metrics(folder: Path, step: int, figures: Mapping[str, Any]) -> None:
    """One JSON object a line, so that a resumed run goes on where it stopped."""
    with (folder / METRICS).open("a", encoding="utf-8") as file:
        file.write(json.dumps({"step": step} | dict(figures)) + "\n")


def read_metrics(folder: Path) -> list[dict[str, Any]]:
    """The lines of the metrics file, without those cut off or damaged."""
    path = folder / METRICS
    if not path.is_file():
        return []
    rows = []
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
        with suppress(ValueError):
            row = json.loads(line)
            if isinstance(row, dict) and "step" in row:
                rows.append(row)
    return rows


def drop_metrics_beyond(folder: Path, steps: int) -> None:
    """Forget what was logged after a checkpoint: it will be logged again."""
    path = folder / METRICS
    if path.is_file():
        with whole_file(path) as part:
            kept = [row for row in read_metrics(folder) if row["step"] <= steps]
            part.write_text("".join(json.dumps(row) + "\n" for row in kept), encoding="utf-8")
