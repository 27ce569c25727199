"""Base class of training runs: run folder, progress and learning curve."""

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
from agents.learned.policy_file import package_versions
from agents.training import run_folder
from agents.training.learning_curve import LearningCurve
from agents.training.recipe import Recipe


@dataclass(frozen=True)
class TrainingProgress:
    """Progress of a training run.

    Attributes:
        steps: environment steps so far.
        total: environment steps of the run.
        reward: mean reward of recent segments; NaN before the first segment ends.
        ticks: mean decision time of recent segments, in ticks; NaN before the first segment ends.
    """

    steps: int
    total: int
    reward: float
    ticks: float

    @property
    def note(self) -> str:
        """Text for a progress display."""
        return "" if math.isnan(self.reward) else f"reward {self.reward:+.3f}, {self.ticks:.1f} ticks"


class Run(ABC):
    """A training run of any algorithm and its folder; see `agents.training.runs.make_run` for the arguments.

    Attributes:
        steps: total environment steps of the run.
        resume: whether the run starts from the checkpoint in its folder.
        seconds: training time so far, without evaluations.
        last_evaluation: last point of the learning curve.
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
        self.last_evaluation: dict[str, float] = {}
        self.curve = LearningCurve(env_id, options)
        torch.set_num_threads(1)  # for small networks the overhead of threads exceeds the gain
        self.build()
        self.start_at(self._prepare_folder())

    @abstractmethod
    def build(self) -> None:
        """Create network and environments; invalid settings are refused before anything is written."""

    @abstractmethod
    def start_at(self, num_timesteps: int) -> None:
        """Set the number of environment steps already made."""

    @property
    @abstractmethod
    def num_timesteps(self) -> int:
        """Environment steps so far."""

    @property
    @abstractmethod
    def network(self) -> nn.Module:
        """The trained module."""

    @property
    @abstractmethod
    def optimizer(self) -> Optimizer:
        """Its optimizer."""

    @abstractmethod
    def family(self, name: str) -> DeciderFamily:
        """Return the current agent as a family of deciders."""

    @abstractmethod
    def train(
        self, on_progress: Callable[[TrainingProgress], None] | None = None, save_every: float = 10.0
    ) -> None:
        """Train for the remaining steps.

        Args:
            on_progress: called after every rollout.
            save_every: seconds between checkpoints.
        """

    @abstractmethod
    def save_agent(self, folder: Path, card: dict[str, Any]) -> None:
        """Write weights and card of the current agent."""

    def _prepare_folder(self) -> int:
        """Create the folder or load its checkpoint; return the environment steps already made."""
        num_timesteps = 0
        if self.folder is None:
            return num_timesteps
        if self.resume:
            progress = run_folder.load_checkpoint(self.folder, self.network, self.optimizer)
            num_timesteps, self.seconds = int(progress["steps"]), progress["seconds"]
            run_folder.drop_metrics_after(self.folder, num_timesteps)
        output_folder("out", self.folder)
        config = {
            "env": self.env_id, "options": self.options, "recipe": self.recipe.as_json(),
            "steps": self.steps, "seed": self.seed,
        }  # fmt: skip
        write_json(self.folder / run_folder.CONFIG, config)
        return num_timesteps

    def evaluate(self) -> None:
        """Add a point of the learning curve to the metrics."""
        assert self.folder is not None
        self.last_evaluation = self.curve.evaluate(self.family(""), self.seconds)
        run_folder.append_metrics(self.folder, self.num_timesteps, self.last_evaluation)
        self.last_evaluation["steps"] = self.num_timesteps

    def save(self) -> None:
        """Write checkpoint and policy."""
        assert self.folder is not None
        progress = {"steps": self.num_timesteps, "seconds": self.seconds}
        run_folder.save_checkpoint(self.folder, self.network.state_dict(), self.optimizer, progress)
        card = {
            "environment": self.env_id, "options": self.options, "recipe": self.recipe.as_json(),
            "seed": self.seed, "steps": self.num_timesteps, "seconds": round(self.seconds, 1),
            "measured": self.last_evaluation, "versions": package_versions(),
        }  # fmt: skip
        self.save_agent(self.folder, card)

    def save_if_new(self) -> None:
        """Write the initial checkpoint, so that a run interrupted before the first one can be resumed."""
        if self.folder is not None and not (self.folder / run_folder.CHECKPOINT).exists():
            self.save()
