"""A policy on disk: weights as safetensors and a JSON card. Nothing is ever unpickled."""

import json
import platform
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

from safetensors import SafetensorError
from safetensors.torch import load_file, save_file
from torch import Tensor

from agents.interface.output_files import whole_file, write_json
from agents.interface.world_arguments import CARD
from hybrid_env.checks import reject
from hybrid_env.observation import HYPOTHESIS_FEATURES, TRACK_FEATURES

WEIGHTS = "policy.safetensors"


SCALES = HYPOTHESIS_FEATURES | TRACK_FEATURES


def versions() -> dict[str, str]:
    """Of what a training depends on."""
    names = ("hybrid-track", "stable-baselines3", "torch", "numpy", "numba")
    return {name: version(name) for name in names} | {"python": platform.python_version()}


def save_policy(folder: Path, weights: Mapping[str, Tensor], card: Mapping[str, Any]) -> None:
    """Write weights and card, each whole or not at all."""
    with whole_file(folder / WEIGHTS) as part:
        save_file({name: tensor.contiguous() for name, tensor in weights.items()}, part)
    write_json(folder / CARD, dict(card) | {"observation_scales": SCALES})


def load_policy(folder: Path) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Weights and card.

    Raises:
        ArgumentError: the folder holds none, damaged ones, or such as read another observation.
    """
    try:
        card = json.loads((folder / CARD).read_text(encoding="utf-8"))
        weights = load_file(folder / WEIGHTS)
        scales, _ = card["observation_scales"], card["recipe"]["entry"]["algo"]
    except (OSError, ValueError, KeyError, TypeError, SafetensorError) as error:
        raise unreadable(folder, error) from None
    if scales != SCALES:
        raise reject(
            "run", str(folder), "a policy trained on today's observation; this one read other scales"
        )
    return weights, card


def unreadable(folder: Path, error: Exception) -> ValueError:
    """The error for a run folder without a whole policy."""
    return reject("run", str(folder), f"a run folder with {WEIGHTS} and {CARD} ({reason_of(error)})")


def reason_of(error: Exception) -> str:
    """The first line of an error."""
    return (str(error).splitlines() or [type(error).__name__])[0]
