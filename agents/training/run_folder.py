"""The run folder: config, checkpoint, metrics as JSON lines, and the policy with its card.

The checkpoint stores weights, optimizer state and progress in one file, so that they are always consistent
after an interruption. Nothing is unpickled.
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

from agents.interface.output_files import atomic_file
from agents.learned.policy_file import first_line
from hybrid_env.checks import reject

CONFIG = "config.json"
CHECKPOINT = "checkpoint.safetensors"
METRICS = "metrics.jsonl"


def save_checkpoint(
    folder: Path, weights: Mapping[str, Tensor], optimizer: Optimizer, progress: Mapping[str, float]
) -> None:
    """Write weights, optimizer state and progress to one file, atomically."""
    tensors = {f"policy.{name}": value.contiguous() for name, value in weights.items()}
    for index, state in optimizer.state_dict()["state"].items():
        tensors |= {f"optimizer.{index}.{name}": value for name, value in state.items()}
    with atomic_file(folder / CHECKPOINT) as part:
        save_file(tensors, part, metadata={name: repr(value) for name, value in progress.items()})


def load_checkpoint(folder: Path, module: Any, optimizer: Optimizer) -> dict[str, float]:
    """Load a checkpoint into a module and its optimizer, and return the saved progress.

    Raises:
        ArgumentError: the checkpoint is missing or damaged.
    """
    try:
        with safe_open(folder / CHECKPOINT, framework="pt") as file:
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
            progress = {name: float(value) for name, value in file.metadata().items()}
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
        progress["steps"] = int(progress["steps"])
    except (
        OSError, AttributeError, KeyError, TypeError, ValueError, RuntimeError, SafetensorError,
    ) as error:  # fmt: skip
        allowed = f"a run folder with a complete {CHECKPOINT} ({first_line(error)})"
        raise reject("resume", str(folder), allowed) from None
    return progress


def read_config(folder: Path) -> dict[str, Any]:
    """Read the config of a run to resume.

    Raises:
        ArgumentError: the config is missing or damaged.
    """
    try:
        config = json.loads((folder / CONFIG).read_text(encoding="utf-8"))
        return {name: config[name] for name in ("env", "options", "recipe", "steps", "seed")}
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise reject("resume", str(folder), f"a run folder with a readable {CONFIG} ({error})") from None


def append_metrics(folder: Path, step: int, metrics: Mapping[str, Any]) -> None:
    """Append one line with a JSON object; a resumed run appends to the same file."""
    with (folder / METRICS).open("a", encoding="utf-8") as file:
        file.write(json.dumps({"step": step} | dict(metrics)) + "\n")


def read_metrics(folder: Path) -> list[dict[str, Any]]:
    """Read the lines of the metrics file, skipping incomplete or damaged ones."""
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


def drop_metrics_after(folder: Path, step: int) -> None:
    """Delete the metrics logged after a checkpoint; the resumed run logs them again."""
    path = folder / METRICS
    if path.is_file():
        with atomic_file(path) as part:
            kept = [row for row in read_metrics(folder) if row["step"] <= step]
            part.write_text("".join(json.dumps(row) + "\n" for row in kept), encoding="utf-8")
