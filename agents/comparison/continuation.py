"""What an interrupted comparison leaves behind and goes on from: its agents and finished sweeps."""

import functools
import hashlib
import json
import zipfile
from contextlib import suppress
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

import agents
import baselines
import hybrid_env
from agents.comparison.plan import Plan
from agents.evaluation.deciders import SHIPPED, SHIPPED_FOLDER, DeciderFamily
from agents.evaluation.evaluate import Decisions
from agents.evaluation.operating_curve import OperatingCurve
from agents.interface.output_files import atomic_file, output_folder
from agents.learned.policy_file import WEIGHTS, package_versions
from agents.training.recipe import Recipe

TRAINED = "agents"
UNFINISHED = "unfinished"
ARRAYS = tuple(field.name for field in fields(Decisions) if field.name != "delay_cost")
DAMAGE = (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile)


class Continuation:
    """Files of a comparison in its output folder.

    `agents` has a run folder for each agent that the comparison trains. `unfinished` has the decisions of
    each decider that has been evaluated, until the comparison is complete. The names contain a digest of
    everything that determines the content, with the source code: results of other settings are not used.

    Args:
        plan: settings of the comparison.
        folder: of its output; None writes nothing.
    """

    def __init__(self, plan: Plan, folder: Path | None):
        self.plan, self.folder = plan, folder

    def run_folder(self, recipe: Recipe, seed: int) -> Path | None:
        """Return the run folder of an agent; None without an output folder."""
        if self.folder is None:
            return None
        key = digest([self.plan.env_id, self.plan.options, recipe.as_json(), self.plan.steps])
        return self.folder / TRAINED / f"{recipe.name}-seed{seed}-{key[:8]}"

    def load(self, family: DeciderFamily, weights: str) -> tuple[OperatingCurve, int] | None:
        """Return the operating curve of a decider and the index of its selected threshold, or None.

        Args:
            family: of the decider.
            weights: digest of its weights.
        """
        path = self._path(family, weights)
        if path is None:
            return None
        try:
            with path.open("rb") as stream, np.load(stream, allow_pickle=False) as file:
                chosen, cost = int(file["chosen"]), float(file["delay_cost"])
                thresholds = tuple(file["thresholds"].tolist())
                arrays = {name: file[name] for name in ARRAYS}
        except DAMAGE:
            return None
        decisions = [
            Decisions(**{name: array[k] for name, array in arrays.items()}, delay_cost=cost)
            for k in range(len(thresholds))
        ]
        return OperatingCurve(replace(family, thresholds=thresholds), tuple(decisions)), chosen

    def save(self, family: DeciderFamily, weights: str, curve: OperatingCurve, chosen: int) -> None:
        """Write what `load` returns.

        Raises:
            ArgumentError: the file cannot be written.
        """
        path = self._path(family, weights)
        if path is None:
            return
        output_folder("out", path.parent)
        arrays: dict[str, Any] = {
            name: np.stack([getattr(decisions, name) for decisions in curve.decisions]) for name in ARRAYS
        }
        arrays |= {"chosen": chosen, "delay_cost": curve.decisions[0].delay_cost}
        with atomic_file(path) as part, part.open("wb") as file:
            np.savez(file, thresholds=np.array(curve.family.thresholds), **arrays)

    def finish(self) -> None:
        """Remove the decisions of a complete comparison; the agents stay."""
        if self.folder is not None:
            with suppress(OSError):
                for path in (self.folder / UNFINISHED).glob("*.npz"):
                    path.unlink()
                (self.folder / UNFINISHED).rmdir()

    def _path(self, family: DeciderFamily, weights: str) -> Path | None:
        if self.folder is None:
            return None
        plan = {
            name: value for name, value in asdict(self.plan).items() if name not in ("deciders", "agents")
        }
        key = digest([plan, self.plan.deciders[0], family.name, family.thresholds, family.options, weights])
        return self.folder / UNFINISHED / f"{key[:16]}.npz"


def weights_digest(name: str) -> str:
    """Digest of the weights of 'shipped' or of a run folder; empty for other deciders."""
    path = (SHIPPED_FOLDER if name == SHIPPED else Path(name)) / WEIGHTS
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else ""


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
