"""What every training has in common: its folder, how it stands, and how good its agent is."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from torch import nn
from torch.optim import Optimizer

from agents.evaluation.deciders import DeciderFamily
from agents.interface.output_files import output_folder, write_json
from agents.learned.policy_file import versions
from agents.training import run_folder
from agents.training.learning_curve import LearningCurve
from agents.training.recipe import Recipe


@dataclass(frozen=True)
class TrainingProgress:
    """Where a training run stands.

    Attributes:
        steps, total: environment steps, done and wanted.
        reward: mean of a segment lately; NaN before the first has ended.
        ticks: mean decision time of a segment lately, likewise.
    """

    steps: int
    total: int
    reward: float
    ticks: float

    @property
    def note(self) -> str:
        """For a progress display."""
        return "" if math.isnan(self.reward) else f"reward {self.reward:+.3f}, {self.ticks:.1f} ticks"


class Run(ABC):
    """One training, of any algorithm, and its folder; see `agents.runs.make_run` for the arguments.

    Attributes:
        steps: environment steps wanted.
        resume: whether it goes on from the checkpoint in its folder.
        seconds: of training so far, measurements apart.
        measured: the last point of the learning curve.
    """

    def __init__(
        self,
        env_id: str,
        options: dict[str, Any],
        recipe: Recipe,
        seed: int,
        folder: Path | None,
        steps: int,
        resume: bool = False,
    ):
        self.env_id, self.options, self.recipe = env_id, options, recipe
        self.seed, self.folder, self.steps, self.resume = seed, folder, steps, resume
        self.seconds = 0.0
        self.measured: dict[str, float] = {}
        self.curve = LearningCurve(env_id, options)
        torch.set_num_threads(1)  # small networks lose more to threads than they gain
        self.build()
        self.start(self._begin())

    @abstractmethod
    def build(self) -> None:
        """Make network and tracks; refuse a bad world or recipe before anything is written."""

    @abstractmethod
    def start(self, done: int) -> None:
        """Go on from as many environment steps."""

    @property
    @abstractmethod
    def done(self) -> int:
        """Environment steps made."""

    @property
    @abstractmethod
    def network(self) -> nn.Module:
        """What is trained."""

    @property
    @abstractmethod
    def optimizer(self) -> Optimizer:
        """What trains it."""

    @abstractmethod
    def family(self, name: str) -> DeciderFamily:
        """The agent as it stands, as a decider."""

    @abstractmethod
    def train(
        self, on_progress: Callable[[TrainingProgress], None] | None = None, save_every: float = 10.0
    ) -> None:
        """Train to the end, saving the run every so many seconds."""

    @abstractmethod
    def save_agent(self, folder: Path, card: dict[str, Any]) -> None:
        """Write weights and card of the agent as it stands."""

    def _begin(self) -> int:
        """Make the folder, or read its checkpoint; returns the steps that were made before."""
        done = 0
        if self.folder is None:
            return done
        if self.resume:
            numbers = run_folder.load_checkpoint(self.folder, self.network, self.optimizer)
            done, self.seconds = int(numbers["steps"]), numbers["seconds"]
            run_folder.drop_metrics_beyond(self.folder, done)
        output_folder("out", self.folder)
        config = {
            "env": self.env_id, "options": self.options, "recipe": self.recipe.as_json(),
            "steps": self.steps, "seed": self.seed,
        }  # fmt: skip
        write_json(self.folder / run_folder.CONFIG, config)
        return done

    def measure(self) -> None:
        """A point of the learning curve, into the metrics."""
        assert self.folder is not None
        self.measured = self.curve.measure(self.family(""), self.seconds)
        run_folder.append_metrics(self.folder, self.done, self.measured)
        self.measured["steps"] = self.done

    def save(self) -> None:
        """Write checkpoint and policy."""
        assert self.folder is not None
        numbers = {"steps": self.done, "seconds": self.seconds}
        run_folder.save_checkpoint(self.folder, self.network.state_dict(), self.optimizer, numbers)
        card = {
            "environment": self.env_id, "options": self.options, "recipe": self.recipe.as_json(),
            "seed": self.seed, "steps": self.done, "seconds": round(self.seconds, 1),
            "measured": self.measured, "versions": versions(),
        }  # fmt: skip
        self.save_agent(self.folder, card)

    def save_if_new(self) -> None:
        """The first checkpoint, so that a run killed before its first interval can go on, too."""
        if self.folder is not None and not (self.folder / run_folder.CHECKPOINT).exists():
            self.save()
