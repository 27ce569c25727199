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

from agents.interface.input_files import read_json
from agents.interface.output_files import atomic_file, write_json
from agents.interface.world_arguments import CARD
from baselines.rules.decider import ANNOUNCED, FLIGHTS, GLIDERS, UNKNOWN
from hybrid_env.checks import check_flag, check_integer, reject
from hybrid_env.observation import Layout, QuickestLayout

WEIGHTS = "policy.safetensors"
LAYOUTS: dict[str, type[Layout]] = {ANNOUNCED: Layout, UNKNOWN: QuickestLayout}
ALGORITHMS = {
    "ppo": (ANNOUNCED, UNKNOWN), "recurrent_ppo": (ANNOUNCED, UNKNOWN), "anchor": (ANNOUNCED,),
    "reward": (ANNOUNCED,), "tandem": (ANNOUNCED,), "statements": (UNKNOWN,), "rhythm": (UNKNOWN,),
    "flights": (FLIGHTS,), "gliders": (GLIDERS,), "kalman": (ANNOUNCED,), "distilled": (ANNOUNCED,),
    "transformer": (ANNOUNCED,),
}  # fmt: skip
"""Tasks of the agents of every training algorithm."""

LARGEST_FILE = 2**27  # bytes
LARGEST_HEADER = 2**20  # bytes
LARGEST_WEIGHT = 1e6  # decisions of larger weights could overflow


def package_versions() -> dict[str, str]:
    """Return the versions of Python and of the packages that determine the result of a training run."""
    names = ("hybrid-track", "stable-baselines3", "torch", "numpy", "numba")
    return {name: version(name) for name in names} | {"python": platform.python_version()}


def save_policy(folder: Path, weights: Mapping[str, Tensor], card: Mapping[str, Any], task: str) -> None:
    """Write weights and card, with the scales of the observation rows of the task, if it has rows.

    Each file is written atomically.
    """
    with atomic_file(folder / WEIGHTS) as part:
        save_file({name: tensor.contiguous() for name, tensor in weights.items()}, part)
    scales = {"observation_scales": _scales(LAYOUTS[task])} if task in LAYOUTS else {}
    write_json(folder / CARD, dict(card) | scales)


def _scales(layout: type[Layout]) -> dict[str, float]:
    return layout.hypothesis_features | layout.track_features


def card_task(card: Mapping[str, Any]) -> str:
    """Return the task that a policy was trained for, from a card of `load_policy`."""
    tasks = ALGORITHMS[card["recipe"]["entry"]["algo"]]
    if tasks[0] not in LAYOUTS:
        return tasks[0]
    return next(task for task in tasks if card["observation_scales"] == _scales(LAYOUTS[task]))


def load_policy(folder: Path) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Read weights and card of any agent.

    Raises:
        ArgumentError: the files are missing or damaged, or the policy was trained with other observation
            scales.
    """
    try:
        card = read_json(folder / CARD)
        if "settings" in card:  # the card of an agent for flights that was trained without a recipe
            card["recipe"] = {"name": "flights", "entry": {"algo": "flights", **card["settings"]}}
        algo = card["recipe"]["entry"]["algo"]
        if algo not in ALGORITHMS:
            raise reject("algo", algo, ", ".join(ALGORITHMS))
        rows = [LAYOUTS[task] for task in ALGORITHMS[algo] if task in LAYOUTS]
        is_known = not rows or card["observation_scales"] in [_scales(layout) for layout in rows]
        weights = _read_tensors(folder / WEIGHTS)
    except (OSError, ValueError, KeyError, TypeError, SafetensorError) as error:
        raise unreadable_policy(folder, error) from None
    if not is_known:
        raise reject(
            "run", str(folder), "a policy trained with the current observation scales; this one has other scales"
        )
    return weights, card


def _read_tensors(path: Path) -> dict[str, Tensor]:
    """Read tensors of finite float32 numbers; others raise `OSError`, `SafetensorError` or `ValueError`."""
    check_tensor_file(path, LARGEST_FILE)
    tensors = {}
    with safe_open(path, framework="pt") as file:
        for name in file.keys():  # noqa: SIM118
            if file.get_slice(name).get_dtype() != "F32":
                raise ValueError(f"{name} in {path.name} is not of float32 numbers")
            tensor = tensors[name] = file.get_tensor(name)
            if not (tensor.abs() <= LARGEST_WEIGHT).all():
                raise ValueError(
                    f"{name} in {path.name} is not of finite numbers of magnitude at most {LARGEST_WEIGHT:g}"
                )
    return tensors


def check_tensor_file(path: Path, largest: int) -> None:
    """Check the size of a safetensors file and of its header, in bytes, before it is read.

    Raises:
        OSError: the file cannot be read.
        ValueError: it is missing or too large.
    """
    if not path.is_file():  # a named pipe would wait for its writer
        raise ValueError(f"{path.name} is missing or not a file")
    with path.open("rb") as start:
        header = int.from_bytes(start.read(8), "little")
    if path.stat().st_size > largest or header > LARGEST_HEADER:
        raise ValueError(f"{path.name} is larger than {largest:,} bytes, or its header is too large")


Network = TypeVar("Network", bound=torch.nn.Module)


def load_network(
    folder: Path, weights: Mapping[str, Tensor], card: dict[str, Any], kind: Callable[[int], Network]
) -> Network:
    """Return a network for the weights and card that `load_policy` read from a folder.

    Args:
        kind: creates it with a number of hidden units.

    Raises:
        ArgumentError: weights and card do not match.
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
    """Put weights into a module, which may have been created without memory, on the device "meta".

    Raises:
        ValueError: names or shapes differ.
    """
    expected = {name: tuple(tensor.shape) for name, tensor in module.state_dict().items()}
    found = {name: tuple(tensor.shape) for name, tensor in weights.items()}
    for name in sorted(expected | found):
        if found.get(name) != expected.get(name):
            raise ValueError(
                f"weights {name} have the shape {found.get(name)}, not {expected.get(name)} as on the card"
            )
    module.load_state_dict(weights, assign=True)


def unreadable_policy(folder: Path, error: Exception) -> ValueError:
    """Return the error for a run folder without a complete policy."""
    reason = f"no {error}" if isinstance(error, KeyError) else first_line(error)
    return reject("run", str(folder), f"a run folder with {WEIGHTS} and {CARD} ({reason})")


def first_line(error: Exception) -> str:
    """Return the first line of an error message."""
    return (str(error).splitlines() or [type(error).__name__])[0]


LARGEST_HIDDEN = 512  # units of a hidden layer of the anchor agent
LARGEST_LAYER = 1024
MOST_LAYERS = 8
ACTOR_CRITIC_SETTINGS = ("net_arch", "ortho_init")
LSTM_SETTINGS = ("lstm_hidden_size", "n_lstm_layers", "enable_critic_lstm")


def check_policy_kwargs(policy_kwargs: Any, recurrent: bool) -> None:
    """Check the keyword arguments of an actor-critic policy of Stable-Baselines3 or sb3-contrib.

    Raises:
        ArgumentError: an unknown name, a wrong type, or a network that is too large.
    """
    known = ACTOR_CRITIC_SETTINGS + (LSTM_SETTINGS if recurrent else ())
    if not isinstance(policy_kwargs, Mapping) or any(name not in known for name in policy_kwargs):
        raise reject("policy_kwargs", policy_kwargs, f"a mapping of {', '.join(known)}")
    layers = policy_kwargs.get("net_arch", [1])
    if not isinstance(layers, list) or not 1 <= len(layers) <= MOST_LAYERS:
        raise reject("net_arch", layers, f"a list of one to {MOST_LAYERS} layers")
    for units in layers:
        check_integer("net_arch", units, maximum=LARGEST_LAYER)
    for name, largest in (("lstm_hidden_size", LARGEST_LAYER), ("n_lstm_layers", 2)):
        check_integer(name, policy_kwargs.get(name, 1), maximum=largest)
    for name in ("ortho_init", "enable_critic_lstm"):
        check_flag(name, policy_kwargs.get(name, True))
