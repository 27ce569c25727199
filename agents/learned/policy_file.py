"""A policy on disk: weights as safetensors and a card as JSON. Nothing is unpickled."""

import importlib
import platform
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import torch
import yaml
from safetensors import SafetensorError
from safetensors.torch import load_file, save_file
from torch import Tensor

from agents.interface.output_files import atomic_file, write_json
from agents.interface.world_arguments import CARD
from agents.learned.algorithm_names import find_algorithm
from agents.learned.torch_defaults import NetworkDecider, Units, torch_defaults
from baselines.rules.decider import ANNOUNCED, UNKNOWN, Decider
from hybrid_env.checks import checked, reject
from hybrid_env.json_files import read_json
from hybrid_env.observation import Layout, QuickestLayout

WEIGHTS = "policy.safetensors"
LAYOUTS: dict[str, type[Layout]] = {ANNOUNCED: Layout, UNKNOWN: QuickestLayout}

# Bytes.
LARGEST_POLICY = 2**27


def package_versions() -> dict[str, str]:
    """Return the versions of Python and of the packages that determine the result of a training
    run.
    """
    names = ("hybrid-track", "stable-baselines3", "torch", "numpy", "numba")
    return {name: version(name) for name in names} | {"python": platform.python_version()}


def save_policy(
    folder: Path, weights: Mapping[str, Tensor], card: Mapping[str, Any], task: str
) -> None:
    """Write weights and card atomically, with the scales of the observation rows of the task, if
    it has rows.
    """
    with atomic_file(folder / WEIGHTS) as part:
        save_file({name: tensor.contiguous() for name, tensor in weights.items()}, part)
    write_json(folder / CARD, {**card, "observation_scales": _scales(task)})
    with atomic_file(folder / "README.md") as part:
        part.write_text(hub_card(folder.name, card), encoding="utf-8")


def hub_card(name: str, card: Mapping[str, Any]) -> str:
    """Return the page of a policy on a hub, with the metadata of Hugging Face's model cards."""
    env_id = card["environment"].rpartition(":")[2]
    kind = "reinforcement-learning"
    result = {
        "task": {"type": kind, "name": kind},
        "dataset": {"type": env_id, "name": env_id},
        "metrics": [{"type": "mean_reward", "value": card["measured"].get("evaluation/reward")}],
    }
    metadata = {
        "library_name": "hybrid-track",
        "tags": [kind, env_id],
        "model-index": [{"name": name, "results": [result]}],
    }
    return (
        f"---\n{yaml.safe_dump(metadata, sort_keys=False)}---\n# {name}\n\n"
        f"A policy of HybridTrack for `{env_id}`, after {card['steps']:,} steps. `{CARD}` has its"
        " recipe, settings, seed, versions and scores.\n\n"
        "    hybridtrack evaluate FOLDER\n"
    )


def _scales(task: str) -> dict[str, float] | None:
    layout = LAYOUTS.get(task)
    return None if layout is None else layout.scales_by_name()


@dataclass(frozen=True)
class SavedPolicy:
    """Weights and card of an agent, see `load_policy`."""

    folder: Path
    card: dict[str, Any]
    # Class of the decider, or of the algorithm of a library.
    kind: Any
    weights: dict[str, Tensor]

    @property
    def entry(self) -> dict[str, Any]:
        """Hyper-parameters on the card."""
        entry: dict[str, Any] = self.card["recipe"]["entry"]
        return entry

    @property
    def task(self) -> str:
        """What the agent was trained for, see `Decider.task`; empty if its rows had other scales
        than those of today.
        """
        scales = self.card.get("observation_scales")
        tasks = [self.kind.task] if issubclass(self.kind, NetworkDecider) else self.kind.tasks
        return next((task for task in tasks if _scales(task) == scales), "")

    def load(self, options: Any) -> Decider:
        """Return the agent for the options of an environment; None where it needs none."""
        if issubclass(self.kind, NetworkDecider):
            return self.kind(load_network(self), *(() if options is None else (options,)))
        decider: Decider = self.kind.load(self, options)
        return decider


def find_kind(algo: Any, decider: Any) -> Any:
    """Return the class that decides with weights, by the names on their card: the decider if it is
    of this package, or that of the algorithm, or the algorithm of a library.
    """
    # Deciders whose weights come with the package, as on their cards.
    of_package = (
        "agents.learned.anchor_decider:AnchorDecider",
        "agents.learned.statement_decider:StatementDecider",
    )
    if decider in of_package:
        module, _, name = decider.partition(":")
        return getattr(importlib.import_module(module), name)
    algorithm = find_algorithm(algo)
    return getattr(algorithm, "decider", algorithm)


@torch_defaults()
def load_policy(folder: Path) -> SavedPolicy:
    """Read weights and card of any agent; refuse damaged files, and a policy trained with other
    observation scales.
    """
    try:
        card = read_json(folder / CARD)
        names = card["recipe"]["entry"]["algo"], card.get("decider")
        weights = _read_tensors(folder / WEIGHTS)
    except (OSError, ValueError, KeyError, TypeError, SafetensorError) as error:
        raise unreadable_policy(folder, error) from None
    policy = SavedPolicy(folder, card, find_kind(*names), weights)
    if not policy.task:
        allowed = "a policy trained with the current observation scales; this one has other scales"
        raise reject("run", str(folder), allowed)
    return policy


def _read_tensors(path: Path) -> dict[str, Tensor]:
    """Read tensors of finite float32 numbers; others raise `SafetensorError` or `ValueError`."""
    # A named pipe would wait for its writer.
    if not path.is_file() or path.stat().st_size > LARGEST_POLICY:
        raise ValueError(f"{path.name} is missing or larger than {LARGEST_POLICY:,} bytes")
    tensors: dict[str, Tensor] = load_file(path)
    for name, tensor in tensors.items():
        if tensor.dtype != torch.float32:
            raise ValueError(f"{name} in {path.name} is not of float32 numbers")
        check_finite(f"{name} in {path.name}", tensor)
    return tensors


def check_finite(name: str, weights: Tensor) -> Tensor:
    """Return weights; `ValueError` if one is not finite or too large."""
    # Decisions of larger weights could overflow.
    if not (weights.abs() <= 1e6).all():
        raise ValueError(f"{name} is not of finite numbers of magnitude at most 1e+06")
    return weights


@torch_defaults()
def load_network(policy: SavedPolicy) -> torch.nn.Module:
    """Return the network of an agent, for the hyper-parameters on its card; `ArgumentError` if
    weights and card do not match.
    """
    try:
        checked("hidden", policy.entry["hidden"], Units)
        with torch.device("meta"):
            net: torch.nn.Module = policy.kind.network_of(policy.entry)
        net.load_state_dict(policy.weights, assign=True)
    except (KeyError, TypeError, ValueError, RuntimeError) as error:
        raise unreadable_policy(policy.folder, error) from None
    net.eval()
    return net


def unreadable_policy(folder: Path, error: Exception) -> ValueError:
    """Return the error for a run folder without a complete policy."""
    reason = f"no {error}" if isinstance(error, KeyError) else short_message(error)
    return reject("run", str(folder), f"a run folder with {WEIGHTS} and {CARD} ({reason})")


def short_message(error: Exception) -> str:
    """Return an error message as one line of at most 200 characters."""
    return " ".join(str(error).split())[:200] or type(error).__name__
