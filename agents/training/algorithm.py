"""Base class of training algorithms: run folder, checkpoints, progress and learning curve."""

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, TypeAlias

import torch
from torch import Tensor, nn
from torch.optim import Optimizer

from agents.interface.output_files import output_folder, write_json
from agents.learned.algorithm_names import REGISTERED
from agents.learned.policy_file import package_versions, save_policy
from agents.learned.torch_defaults import torch_defaults
from agents.training import checkpoint, run_folder
from agents.training.learning_curve import LearningCurve, environment_curve
from agents.training.recipe import Recipe
from agents.training.settings import learning_rate_schedule
from baselines.rules.decider import Decider
from hybrid_env.checks import ArgumentError, check_integer, reject


@dataclass(frozen=True)
class TrainingProgress:
    """Progress of a training run; NaN where there is no value yet."""

    # Environment steps so far.
    steps: int
    # Environment steps of the run.
    total: int
    # Mean of recent segments, or of recent ticks where a mode is stated at every tick.
    reward: float
    # Mean decision time of recent segments; NaN where a mode is stated at every tick.
    ticks: float

    @property
    def note(self) -> str:
        """Text for a progress display."""
        if math.isnan(self.reward):
            return ""
        reward = f"reward {self.reward:+.3f}"
        return (
            f"{reward} per tick" if math.isnan(self.ticks) else f"{reward}, {self.ticks:.1f} ticks"
        )


OnRound: TypeAlias = Callable[[TrainingProgress], None] | None
"""Called after each round with its progress."""


class Algorithm(ABC):
    """A training algorithm. An instance is a training run and its folder; see
    `agents.training.runs.make_run` for the arguments.

    A subclass with `Settings` is found by its `name`, see `algorithm_names`; nothing else lists it.

    A checkpoint is written between two rollouts and holds everything that the following ones depend
    on. A resumed run therefore equals an uninterrupted one, apart from times. What is logged must
    depend on steps only, not on times, for the same reason. `build` sets network and optimizer.
    """

    name: ClassVar[str]
    """In recipes and cards of weights; by default "package.module:Name"."""
    Settings: ClassVar[type[Any]]
    """Dataclass of its hyper-parameters."""
    tasks: ClassVar[tuple[str, ...]]
    """What its agents may decide, see `Decider.task`."""
    switches: str
    """What the agent decides."""
    network: Any
    """The network of PyTorch that is trained."""
    optimizer: Optimizer
    next_command: ClassVar[str] = "hybridtrack evaluate"
    """Command that evaluates a run folder."""

    def __init_subclass__(cls, **keywords: Any):
        super().__init_subclass__(**keywords)
        if "name" not in vars(cls):
            cls.name = f"{cls.__module__}:{cls.__qualname__}"
        if hasattr(cls, "Settings"):
            REGISTERED[cls.name] = cls

    @classmethod
    def settings_of(cls, entry: Mapping[str, Any]) -> Any:
        """Return the checked `Settings` of hyper-parameters."""
        return cls.Settings(**entry)

    @classmethod
    def run_name(cls, env_id: str, recipe: str) -> str:
        """Return the name of the folder of a run, from environment and recipe."""
        return f"{env_id.rpartition(':')[2]}-{recipe}"

    @torch_defaults()
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
        self.seed, self.folder, self.steps = seed, folder, steps
        self.settings: Any = recipe.settings
        saved = checkpoint.read_checkpoint(folder) if resume and folder is not None else None
        if folder is not None and saved is None and not run_folder.is_free(folder):
            allowed = "a new or empty folder, or --resume to resume a run"
            raise reject("out", str(folder), allowed)
        # Without evaluations; environment steps.
        self.seconds = 0.0
        self.num_timesteps = 0
        # Last point of the learning curve.
        self.last_evaluation: dict[str, float] = {}
        self.curve = self.make_curve()
        # For small networks the overhead of threads exceeds the gain.
        torch.set_num_threads(1)
        self.build()
        if folder is not None and saved is not None:
            try:
                self._restore(saved)
            except Exception as error:
                raise checkpoint.incomplete_checkpoint(folder, error) from None

    def make_curve(self) -> LearningCurve:
        """Return the learning curve of a new run."""
        # At least ten points after the first.
        return environment_curve(self.env_id, self.options, self.steps / 10)

    @abstractmethod
    def build(self) -> None:
        """Create network and tracks; invalid settings are refused before anything is written."""

    def track_tensors(self) -> dict[str, Tensor]:
        """Return the state of tracks and policy between two rollouts; writing into it changes
        the run.
        """
        return {}

    def values(self) -> dict[str, Any]:
        """Return counters and random generators of the algorithm, as tensors or plain values."""
        return {}

    @abstractmethod
    def restore_values(self, values: dict[str, Any]) -> None:
        """Set the values of a checkpoint, and check the tracks, whose tensors have been
        restored.
        """

    @abstractmethod
    def agent(self, title: str) -> Decider:
        """Return the current agent."""

    @abstractmethod
    def learn(self, on_progress: OnRound) -> None:
        """Make the remaining steps; call `between_updates` before every rollout."""

    @torch_defaults()
    def train(self, on_progress: OnRound = None, save_every: float = 10.0) -> None:
        """Train for the remaining steps, with a checkpoint every `save_every` seconds.

        Raises:
            ArgumentError: another training uses the folder, a file cannot be written, or the
                training diverges.
            OSError: the folder cannot be written.
        """
        self._save_every, self._last_save = save_every, time.monotonic()
        self._started = time.monotonic() - self.seconds
        if self.folder is None:
            self.learn(on_progress)
            return
        with run_folder.lock(output_folder(self.folder)):
            run_folder.drop_metrics_after(self.folder, self.num_timesteps)
            run_folder.delete_temporary_files(self.folder)
            config = {
                "env": self.env_id,
                "options": self.options,
                "recipe": self.recipe.as_json(),
                "steps": self.steps,
                "seed": self.seed,
            }
            write_json(self.folder / run_folder.CONFIG, config)
            if self.num_timesteps < self.steps:
                self.learn(on_progress)
                self.seconds = time.monotonic() - self._started
                self.evaluate()
                self.save()
            else:
                # The run may have been killed between its last checkpoint and the files of the
                # agent.
                self.save_agent(self.folder)

    def between_updates(self) -> None:
        """Evaluate and save the agent if this is due; the time that it takes is not training
        time.
        """
        now = time.monotonic()
        self.seconds = now - self._started
        if self.folder is not None:
            if self.curve.due(self.num_timesteps):
                self.evaluate()
            if now - self._last_save > self._save_every or not checkpoint.has_checkpoint(
                self.folder
            ):
                self.save()
                self._last_save = time.monotonic()
        self._started = time.monotonic() - self.seconds

    def evaluate(self) -> None:
        """Add a point of the learning curve to the metrics."""
        assert self.folder is not None
        self.last_evaluation = self.curve.evaluate(self.agent(""), self.num_timesteps, self.seconds)
        run_folder.append_metrics(self.folder, self.num_timesteps, self.last_evaluation)
        self.last_evaluation["steps"] = self.num_timesteps

    def save(self) -> None:
        """Write checkpoint and agent; `ArgumentError` if a file cannot be written, or a weight
        is not finite.
        """
        assert self.folder is not None
        if not all(tensor.isfinite().all() for tensor in self.network.state_dict().values()):
            raise ArgumentError("the training has diverged: a weight is not finite")
        state = {
            "steps": self.num_timesteps,
            "seconds": self.seconds,
            "measured": self.last_evaluation,
            "network": self.network.state_dict(),
            "optimizer": self.optimizer.state_dict(),
            # Without the memory of arrays of which they are parts.
            "tracks": {
                name: tensor.clone(memory_format=torch.contiguous_format)
                for name, tensor in self.track_tensors().items()
            },
            "values": self.values(),
        }
        checkpoint.write_checkpoint(self.folder, state)
        self.save_agent(self.folder)

    def card(self) -> dict[str, Any]:
        """Return what is written beside the weights."""
        return {
            "environment": self.env_id,
            "options": self.options,
            "recipe": self.recipe.as_json(),
            "seed": self.seed,
            "steps": self.num_timesteps,
            "seconds": round(self.seconds, 1),
            "measured": self.last_evaluation,
            "versions": package_versions(),
        }

    def save_agent(self, folder: Path) -> None:
        """Write weights and card of the current agent."""
        save_policy(folder, self.network.state_dict(), self.card(), self.switches)

    def _restore(self, state: dict[str, Any]) -> None:
        """Set everything that `save` wrote."""
        self.num_timesteps = check_integer("steps", state["steps"], minimum=0)
        self.seconds = float(state["seconds"])
        self.last_evaluation = dict(state["measured"])
        self.network.load_state_dict(state["network"])
        self.optimizer.load_state_dict(state["optimizer"])
        checkpoint.copy_tensors(state["tracks"], self.track_tensors())
        self.restore_values(state["values"])
        self.curve.skip(self.num_timesteps)


class NetworkAlgorithm(Algorithm):
    """Trains a network of PyTorch with Adam, in rounds."""

    smallest_factor: ClassVar[float]
    """Lower bound of the learning rate, as a factor of the first one, while it decays linearly."""
    decider: ClassVar[Any]
    """Class of the agent, such as `UtilityDecider`."""
    world: Any = None
    """Options of the environment of the agent, None if it has none."""
    rounds: int = 0
    """Number of rounds so far, where a round is determined by its number."""

    def __init_subclass__(cls, **keywords: Any):
        super().__init_subclass__(**keywords)
        if hasattr(cls, "decider"):
            cls.switches = cls.decider.task
            cls.tasks = (cls.switches,)

    def prepare(self) -> None:
        """Check and create what is to be simulated, before there is a network."""

    def build(self) -> None:
        """Create network and optimizer."""
        self.prepare()
        torch.manual_seed(self.seed)
        self.network = self.create_network()
        self._rate, self._decays = learning_rate_schedule(self.settings.learning_rate)
        self.optimizer = torch.optim.Adam(self.network.parameters(), lr=self._rate)
        # A part without samples yet has no gradient.
        for parameter in self.network.parameters():
            parameter.grad = torch.zeros_like(parameter)
        if self.world is not None:
            self.agent("").for_modes(self.world)

    def create_network(self) -> nn.Module:
        """Return the network at the beginning of the training."""
        network: nn.Module = self.decider.network_of(vars(self.settings))
        return network

    def improve(self, loss: Tensor, largest: float, *parts: nn.Module) -> None:
        """Make a step of the optimizer; `largest` is the norm of the gradient of each part of the
        network.
        """
        self.optimizer.zero_grad(set_to_none=False)
        loss.backward()
        for part in parts:
            nn.utils.clip_grad_norm_(part.parameters(), largest)
        self.optimizer.step()

    def agent(self, title: str) -> Decider:
        """See `Algorithm.agent`; for the environment of the run."""
        world = () if self.world is None else (self.world,)
        decider: Decider = self.decider(self.network, *world).changed(title=title)
        return decider

    def card(self) -> dict[str, Any]:
        """See `Algorithm.card`; with the decider, for which the algorithm need not be imported if
        it is of this package.
        """
        name = f"{self.decider.__module__}:{self.decider.__qualname__}"
        return super().card() | {"decider": name}

    def values(self) -> dict[str, Any]:
        """See `Algorithm.values`: a round is determined by its number, unless there is more."""
        return {"rounds": self.rounds}

    def restore_values(self, values: dict[str, Any]) -> None:
        """See `Algorithm.restore_values`."""
        self.rounds = int(values["rounds"])

    @abstractmethod
    def train_round(self) -> tuple[int, float, float, dict[str, float]]:
        """Simulate, and train on it; return the environment steps, reward and ticks as in
        `TrainingProgress`, and metrics of the run folder.
        """

    def learn(self, on_progress: OnRound) -> None:
        while self.num_timesteps < self.steps:
            self.between_updates()
            steps, reward, ticks, metrics = self.train_round()
            self.rounds += 1
            self.num_timesteps += steps
            if on_progress is not None:
                on_progress(TrainingProgress(self.num_timesteps, self.steps, reward, ticks))
            if self.folder is not None:
                metrics["seconds"] = self.seconds
                run_folder.append_metrics(self.folder, self.num_timesteps, metrics)

    def set_learning_rate(self) -> None:
        """Set the learning rate of the next update."""
        factor = max(self.smallest_factor, self.remaining()) if self._decays else 1.0
        for group in self.optimizer.param_groups:
            group["lr"] = self._rate * factor

    def remaining(self) -> float:
        """Return the share of the training that remains."""
        return 1.0 - self.num_timesteps / self.steps
