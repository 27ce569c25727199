"""A policy on disk: weights as safetensors and a card as JSON. Nothing is unpickled."""

import platform
from collections.abc import Callable, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor

from agents.algorithms import find_algorithm
from agents.interface.input_files import read_json
from agents.interface.output_files import atomic_file, write_json
from agents.interface.world_arguments import CARD
from agents.learned.torch_defaults import own_defaults
from baselines.rules.decider import ANNOUNCED, UNKNOWN
from hybrid_env.checks import check_integer, reject
from hybrid_env.observation import Layout, QuickestLayout

WEIGHTS = "policy.safetensors"
LAYOUTS: dict[str, type[Layout]] = {ANNOUNCED: Layout, UNKNOWN: QuickestLayout}

# Bytes.
LARGEST_FILE = 2**27
# Bytes.
LARGEST_HEADER = 2**20
# Units of a hidden layer.
LARGEST_HIDDEN = 512
# Of an observation row.
LARGEST_WIDTH = 2000
# Characters of a reason in a message.
LONGEST_LINE = 200
# Decisions of larger weights could overflow.
LARGEST_WEIGHT = 1e6


def package_versions() -> dict[str, str]:
    """Return the versions of Python and of the packages that determine the result of a training
    run.
    """
    names = ("hybrid-track", "stable-baselines3", "torch", "numpy", "numba")
    return {name: version(name) for name in names} | {"python": platform.python_version()}


def save_policy(
    folder: Path,
    weights: Mapping[str, Tensor],
    card: Mapping[str, Any],
    task: str,
) -> None:
    """Write weights and card atomically, with the scales of the observation rows of the task, if
    it has rows.
    """
    with atomic_file(folder / WEIGHTS) as part:
        save_file({name: tensor.contiguous() for name, tensor in weights.items()}, part)
    scales = {"observation_scales": _scales(LAYOUTS[task])} if task in LAYOUTS else {}
    write_json(folder / CARD, dict(card) | scales)


def _scales(layout: type[Layout]) -> dict[str, float]:
    return layout.hypothesis_features | layout.track_features


def card_task(card: Mapping[str, Any]) -> str:
    """Return the task that a policy was trained for, from a card of `load_policy`."""
    tasks: tuple[str, ...] = find_algorithm(card["recipe"]["entry"]["algo"]).tasks
    if tasks[0] not in LAYOUTS:
        return tasks[0]
    return next(task for task in tasks if card["observation_scales"] == _scales(LAYOUTS[task]))


@own_defaults()
def load_policy(folder: Path) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Read weights and card of any agent; refuse damaged files, and a policy trained with other
    observation scales.
    """
    try:
        card = read_json(folder / CARD)
        algo = card["recipe"]["entry"]["algo"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise unreadable_policy(folder, error) from None
    rows = [LAYOUTS[task] for task in find_algorithm(algo).tasks if task in LAYOUTS]
    try:
        is_known = not rows or card["observation_scales"] in [_scales(layout) for layout in rows]
        weights = _read_tensors(folder / WEIGHTS)
    except (OSError, ValueError, KeyError, TypeError, SafetensorError) as error:
        raise unreadable_policy(folder, error) from None
    if not is_known:
        allowed = "a policy trained with the current observation scales; this one has other scales"
        raise reject("run", str(folder), allowed)
    return weights, card


def _read_tensors(path: Path) -> dict[str, Tensor]:
    """Read tensors of finite float32 numbers; others raise `OSError`, `SafetensorError` or
    `ValueError`.
    """
    check_tensor_file(path, LARGEST_FILE)
    tensors = {}
    with safe_open(path, framework="pt") as file:
        for name in file.keys():  # noqa: SIM118
            if file.get_slice(name).get_dtype() != "F32":
                raise ValueError(f"{name} in {path.name} is not of float32 numbers")
            tensors[name] = check_finite(f"{name} in {path.name}", file.get_tensor(name))
    return tensors


def check_finite(name: str, weights: Tensor) -> Tensor:
    """Return weights; `ValueError` if one is not finite or too large."""
    if not (weights.abs() <= LARGEST_WEIGHT).all():
        raise ValueError(f"{name} is not of finite numbers of magnitude at most {LARGEST_WEIGHT:g}")
    return weights


def check_tensor_file(path: Path, largest: int) -> None:
    """Raise `ValueError` if a safetensors file or its header is too large [bytes], before it is
    read.
    """
    # A named pipe would wait for its writer.
    if not path.is_file():
        raise ValueError(f"{path.name} is missing or not a file")
    with path.open("rb") as start:
        header = int.from_bytes(start.read(8), "little")
    if path.stat().st_size > largest or header > LARGEST_HEADER:
        raise ValueError(
            f"{path.name} is larger than {largest:,} bytes, or its header is too large"
        )


Network = TypeVar("Network", bound=torch.nn.Module)


@own_defaults()
def load_network(
    folder: Path,
    weights: Mapping[str, Tensor],
    card: dict[str, Any],
    kind: Callable[[int], Network],
) -> Network:
    """Return a network for the weights and card that `load_policy` read from a folder.

    `kind` creates it with a number of hidden units; `ArgumentError` if weights and card do not
    match.
    """
    try:
        hidden = check_integer("hidden", card["recipe"]["entry"]["hidden"], maximum=LARGEST_HIDDEN)
        with torch.device("meta"):
            net = kind(hidden)
        load_weights(net, weights)
    except (KeyError, TypeError, ValueError, RuntimeError) as error:
        raise unreadable_policy(folder, error) from None
    net.eval()
    return net


def load_weights(module: torch.nn.Module, weights: Mapping[str, Tensor]) -> None:
    """Put weights into a module, which may be on the device "meta"; `ValueError` if names or
    shapes differ.
    """
    expected = {name: tuple(tensor.shape) for name, tensor in module.state_dict().items()}
    found = {name: tuple(tensor.shape) for name, tensor in weights.items()}
    for name in sorted(expected | found):
        if found.get(name) != expected.get(name):
            shapes = f"{found.get(name)}, not {expected.get(name)}"
            raise ValueError(f"weights {name} have the shape {shapes} as on the card")
    module.load_state_dict(weights, assign=True)


def unreadable_policy(folder: Path, error: Exception) -> ValueError:
    """Return the error for a run folder without a complete policy."""
    reason = f"no {error}" if isinstance(error, KeyError) else first_line(error)
    return reject("run", str(folder), f"a run folder with {WEIGHTS} and {CARD} ({reason})")


def first_line(error: Exception) -> str:
    """Return the first line of an error message, cut to `LONGEST_LINE` characters."""
    return (str(error).splitlines() or [type(error).__name__])[0][:LONGEST_LINE]
