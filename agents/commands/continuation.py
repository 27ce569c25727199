"""The plan of a comparison, and what an interrupted one goes on from: its agents and finished
scores.
"""

import functools
import hashlib
import json
import zipfile
from contextlib import suppress
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

import agents
import baselines
import hybrid_env
from agents.evaluation.registry import (
    base_name,
    distinct_titles,
    find_decider,
    is_external,
    is_policy_or_external,
    policy_folder,
    shipped_names,
    split_name,
)
from agents.evaluation.task import Task
from agents.interface.output_files import atomic_file, output_folder
from agents.interface.world_arguments import CARD, trusted
from agents.learned.policy_file import WEIGHTS, package_versions
from baselines.rules.decider import Decider, rules
from baselines.scoring.scores import Scores
from hybrid_env.checks import reject


@dataclass(frozen=True)
class Plan:
    """Settings of a comparison."""

    # What is decided, in which environment.
    task: Task
    # Names of classical rules; the first is the reference.
    deciders: tuple[str, ...]
    # Recipes to train, 'shipped', or run folders.
    agents: tuple[str, ...]
    # Number of episodes that all figures are reported on.
    episodes: int
    # Of the first of them.
    seed: int
    # Number of separate episodes for the selection of thresholds.
    selection_episodes: int
    # Environment steps of each training; None takes the number in the recipe.
    steps: int | None = None
    # Number of agents trained per recipe.
    training_seeds: int = 1
    # Of the thresholds that reach this accuracy, the one with the shortest mean decision time is
    # selected; None selects the threshold with the largest mean reward.
    accuracy: float | None = None
    # False scores all deciders but the reference at their selected threshold only.
    curves: bool = True

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all deciders."""
        return (*self.deciders, *self.agents)

    @property
    def settings(self) -> dict[str, Any]:
        """Plain values of the settings."""
        others = {
            field.name: getattr(self, field.name) for field in fields(self) if field.name != "task"
        }
        return {"env_id": self.task.env_id, "options": dict(self.task.given)} | others

    def find(self, name: str) -> Any:
        """Return a decider, or the recipe of an agent still to be trained."""
        from agents.training.recipe import load_recipe, recipe_names

        if name in self.agents:
            recipes = recipe_names()
            shipped = shipped_names(self.task.switches)
            if (name in recipes and name not in shipped) or str(name).endswith(".yml"):
                return load_recipe(name, self.task.env_id)
            if name not in shipped and not is_policy_or_external(name):
                kinds = "'shipped', a run folder, model.zip, policy.onnx, a recipe as YAML"
                raise reject("agents", name, f"{kinds}, or {', '.join(recipes)}")
        else:
            known, (base, text) = rules(self.task.switches), split_name(name)
            # Thresholds are swept, but not a second one.
            if not (base in known and (not text or "," in text)) and not is_external(name):
                raise reject("deciders", name, f"{', '.join(known)}, or mine.py:MyRule")
        return find_decider(name, self.task.options)

    @cached_property
    def titles(self) -> dict[Any, str]:
        """Titles of all deciders by name, see `distinct_titles`; those of agents are without
        training seeds.
        """
        deciders = map(self.find, self.names)
        titles = distinct_titles(
            self.names,
            [each.title if isinstance(each, Decider) else each.name for each in deciders],
        )
        return dict(zip(self.names, titles, strict=True))

    def calls(self) -> list[tuple[str, int]]:
        """Return name and training seed of everything that is scored."""
        counts = [
            1 if isinstance(self.find(name), Decider) else self.training_seeds
            for name in self.names
        ]
        return [
            (name, k) for name, count in zip(self.names, counts, strict=True) for k in range(count)
        ]


TRAINED = "agents"
UNFINISHED = "unfinished"
EXTRA = "extra "


class Continuation:
    """Files of a comparison in its output folder; without one, nothing is written.

    `agents` has a run folder for each agent that the comparison trains. `unfinished` has the scores
    of each decider that has been evaluated, until the comparison is complete. The names contain a
    digest of everything that determines the content, with the source code: results of other
    settings are not used.
    """

    def __init__(self, settings: dict[str, Any], folder: Path | None):
        self.settings, self.folder = settings, folder

    def run_folder(self, name: str, recipe: dict[str, Any], seed: int) -> Path | None:
        """Return the run folder of an agent; None without an output folder."""
        if self.folder is None:
            return None
        key = digest([self.settings[part] for part in ("env_id", "options", "steps")] + [recipe])
        return self.folder / TRAINED / f"{name}-seed{seed}-{key[:8]}"

    def load(self, key: list[Any]) -> tuple[Scores, int, float] | None:
        """Return what `save` has written for a decider with a key of plain values; None if it is
        lost or damaged.
        """
        path = self._path(key)
        if path is None:
            return None
        try:
            with path.open("rb") as stream, np.load(stream, allow_pickle=False) as file:
                extra = {
                    name.removeprefix(EXTRA): file[name] for name in file if name.startswith(EXTRA)
                }
                names, thresholds, columns = (
                    file[key].tolist() for key in ("names", "thresholds", "columns")
                )
                name, symbol, bank = names
                scores = Scores(
                    name,
                    symbol,
                    tuple(thresholds),
                    tuple(columns),
                    file["values"],
                    extra,
                    bank,
                )
                return scores, int(file["chosen"]), float(file["selected"])
        except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
            return None

    def save(self, key: list[Any], scores: Scores, chosen: int, selected: float) -> None:
        """Write the scores of a decider, the index of its threshold and its goal on the
        selection episodes.
        """
        path = self._path(key)
        if path is None:
            return
        output_folder("out", path.parent)
        arrays: dict[str, Any] = {EXTRA + name: array for name, array in scores.extra.items()}
        arrays |= {
            "names": [scores.name, scores.symbol, scores.bank],
            "thresholds": scores.thresholds,
            "columns": scores.columns,
            "values": scores.values,
            "chosen": chosen,
            "selected": selected,
        }
        with atomic_file(path) as part, part.open("wb") as file:
            np.savez(file, **arrays)

    def finish(self) -> None:
        """Remove the scores of a complete comparison; the agents stay."""
        if self.folder is not None:
            with suppress(OSError):
                for path in (self.folder / UNFINISHED).glob("*.npz"):
                    path.unlink()
                (self.folder / UNFINISHED).rmdir()

    def _path(self, key: list[Any]) -> Path | None:
        if self.folder is None:
            return None
        plan = {
            name: value
            for name, value in self.settings.items()
            if name not in ("deciders", "agents")
        }
        return self.folder / UNFINISHED / f"{digest([plan, key])[:16]}.npz"


def content_digest(name: Any, switches: str) -> str | None:
    """Digest of what a decider is beside this package: the weights and the card of an agent, or the
    file of a policy. None for a user's rule, which may read anything, and empty for a rule of the
    package.
    """
    base = base_name(name)
    # It may run any code.
    if not isinstance(base, str) or (trusted() and Path(base).suffix == ".zip"):
        return None
    if base in rules(switches):
        return ""
    folder = policy_folder(base, switches)
    paths = [folder / WEIGHTS, folder / CARD] if folder.is_dir() else [Path(base)]
    if not all(path.is_file() for path in paths):
        return None
    return hashlib.sha256(b"".join(path.read_bytes() for path in paths)).hexdigest()


def digest(values: Any) -> str:
    """Digest of plain values together with the source code and the versions of packages."""
    text = json.dumps([values, _source_digest(), package_versions()], sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()


@functools.cache
def _source_digest() -> str:
    content = hashlib.sha256()
    for package in (hybrid_env, baselines, agents):
        for path in sorted(Path(package.__path__[0]).rglob("*.py")):
            content.update(path.read_bytes())
    return content.hexdigest()
