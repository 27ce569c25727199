"""A policy on disk: weights as safetensors and a card as JSON. Nothing is unpickled."""

import json
import platform
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

from safetensors import SafetensorError
from safetensors.torch import load_file, save_file
from torch import Tensor

from agents.interface.output_files import atomic_file, write_json
from agents.interface.world_arguments import CARD
from hybrid_env.checks import reject
from hybrid_env.observation import HYPOTHESIS_FEATURES, TRACK_FEATURES

WEIGHTS = "policy.safetensors"
OBSERVATION_SCALES = HYPOTHESIS_FEATURES | TRACK_FEATURES


def package_versions() -> dict[str, str]:
    """Return the versions of Python and of the packages that determine the result of a training run."""
    names = ("hybrid-track", "stable-baselines3", "torch", "numpy", "numba")
    return {name: version(name) for name in names} | {"python": platform.python_version()}


def save_policy(folder: Path, weights: Mapping[str, Tensor], card: Mapping[str, Any]) -> None:
    """Write weights and card. Each file is written atomically."""
    with atomic_file(folder / WEIGHTS) as part:
        save_file({name: tensor.contiguous() for name, tensor in weights.items()}, part)
    write_json(folder / CARD, dict(card) | {"observation_scales": OBSERVATION_SCALES})


def load_policy(folder: Path) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Read weights and card.

    Raises:
        ArgumentError: the files are missing or damaged, or the policy was trained with other observation
            scales.
    """
    try:
        card = json.loads((folder / CARD).read_text(encoding="utf-8"))
        weights = load_file(folder / WEIGHTS)
        scales, _ = card["observation_scales"], card["recipe"]["entry"]["algo"]
    except (OSError, ValueError, KeyError, TypeError, SafetensorError) as error:
        raise unreadable_policy(folder, error) from None
    if scales != OBSERVATION_SCALES:
        raise reject(
            "run",
            str(folder),
            "a policy trained with the current observation scales; this one has other scales",
        )
    return weights, card


def unreadable_policy(folder: Path, error: Exception) -> ValueError:
    """Return the error for a run folder without a complete policy."""
    return reject("run", str(folder), f"a run folder with {WEIGHTS} and {CARD} ({first_line(error)})")


def first_line(error: Exception) -> str:
    """Return the first line of an error message."""
    return (str(error).splitlines() or [type(error).__name__])[0]
