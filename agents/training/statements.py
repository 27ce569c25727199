"""Training of the agent that states a mode at every tick, on its expected reward.

Every round simulates new tracks. They are divided into batches, and each batch into pieces of some ticks; one
step of the optimizer is made for every piece. A round is determined by its number, so that a checkpoint
between two rounds needs no other state than the network and its optimizer.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from agents.evaluation import seeds
from agents.evaluation.deciders import DeciderFamily
from agents.evaluation.statement_deciders import statement_net_family
from agents.learned.policy_file import save_policy
from agents.learned.statement_inputs import count_ages, statement_inputs
from agents.learned.statement_net import StatementNet
from agents.training import run_folder
from agents.training.learning_curve import LearningCurve
from agents.training.own_network_run import OwnNetworkRun
from agents.training.run import TrainingProgress
from agents.training.statement_learning_curve import StatementLearningCurve
from agents.training.statement_reward import expected_reward
from agents.training.statement_settings import StatementSettings
from hybrid_env.checks import reject
from hybrid_env.observation import QuickestLayout
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.registration import environment_options, make_track_vector_env
from hybrid_env.vector_env import HybridTrackQuickestVectorEnv

LARGEST_GRADIENT = 0.5  # norm
LARGEST_ROUND = 2**22  # tracks x ticks x turns, whose inputs take half a gigabyte

Batch = tuple[Tensor, Tensor, Tensor]
"""Inputs (T, N, M - 1, 26), log-probabilities (T, N, M) and true modes (T, N)."""


class StatementRun(OwnNetworkRun):
    """A training run on the expected reward; see `agents.training.runs.make_run` for the arguments.

    Raises:
        ArgumentError: an environment in which modes are not stated, or a damaged checkpoint.
    """

    curve_class: ClassVar[type[LearningCurve]] = StatementLearningCurve
    smallest_factor: ClassVar[float] = 0.01

    def build(self) -> None:
        """Create network and optimizer."""
        assert isinstance(self.recipe.settings, StatementSettings)
        self.settings = self.recipe.settings
        if environment_options(self.env_id) is not QuickestOptions:
            raise reject("env", self.env_id, "an environment in which a mode is stated at every tick")
        world = make_track_vector_env(self.env_id, 1, **self.options).options
        assert isinstance(world, QuickestOptions)
        self.world = world
        torch.manual_seed(self.seed)
        self.net = StatementNet(self.settings.hidden)
        self.start(self.net, self.settings.learning_rate)
        self._round_tracks = len(self.settings.durations) * self.settings.n_envs
        if self._round_tracks * world.ticks * (world.hypotheses - 1) > LARGEST_ROUND:
            allowed = f"n_envs x laws x ticks x (M - 1) of at most {LARGEST_ROUND:,}"
            raise reject("n_envs", self.settings.n_envs, allowed)

    def track_tensors(self) -> dict[str, Tensor]:
        """See `Run.track_tensors`. There are none between two rounds."""
        return {}

    def values(self) -> dict[str, Any]:
        """See `Run.values`."""
        return {}

    def restore_values(self, values: dict[str, Any]) -> None:
        """See `Run.restore_values`."""
        if self.num_timesteps % (self._round_tracks * self.world.ticks):
            raise ValueError("the number of steps is not one of complete rounds")

    def learn(self, on_progress: Callable[[TrainingProgress], None] | None) -> None:
        """Train for the remaining steps; see `Run.learn`."""
        while self.num_timesteps < self.steps:
            self.between_updates()
            self.set_learning_rate()
            rewards, entropies = zip(*map(self._train_on, self._batches()), strict=True)
            self.num_timesteps += self._round_tracks * self.world.ticks
            reward = float(np.mean(rewards))
            if on_progress is not None:
                on_progress(TrainingProgress(self.num_timesteps, self.steps, reward, float("nan")))
            if self.folder is not None:
                metrics = {"expected_reward": reward, "cross_entropy": float(np.mean(entropies))}
                metrics["seconds"] = self.seconds
                run_folder.append_metrics(self.folder, self.num_timesteps, metrics)

    def _batches(self) -> Iterator[Batch]:
        """Simulate the tracks of a round, and divide them at random."""
        number = self.num_timesteps // (self._round_tracks * self.world.ticks)
        first = seeds.TRAINING + self.seed * 10**9 + number * self._round_tracks
        generator = np.random.default_rng(first)
        parts = [
            simulate(self._draw_world(generator, law), self.settings.n_envs, first + k * self.settings.n_envs)
            for k, law in enumerate(self.settings.durations)
        ]
        inputs, log_probability, true_modes = (
            np.concatenate(part, axis=1) for part in zip(*parts, strict=True)
        )
        order = generator.permutation(self._round_tracks)
        for start in range(0, len(order), self.settings.batch_size):
            tracks = order[start : start + self.settings.batch_size]
            yield (
                torch.from_numpy(inputs[:, tracks]),
                torch.from_numpy(log_probability[:, tracks]),
                torch.from_numpy(true_modes[:, tracks]),
            )

    def _draw_world(self, generator: np.random.Generator, law: str) -> QuickestOptions:
        variance, radius = (
            np.exp(generator.uniform(*np.log(range_)))
            for range_ in (self.settings.variances, self.settings.radii)
        )
        variances = tuple(variance * self.world.variances)
        return replace(
            self.world,
            durations=law,
            measurement_variance=variances if len(variances) == 2 else variances[0],
            radii=tuple(radius * np.array(self.world.radii)),
        )

    def _train_on(self, batch: Batch) -> tuple[float, float]:
        """Make one step of the optimizer for each piece; return the means of reward and cross-entropy."""
        memory = last = None
        totals = np.zeros(2)
        pieces = list(zip(*(part.split(self.settings.n_steps) for part in batch), strict=True))
        for inputs, log_probability, true_modes in pieces:
            outputs = self.net(inputs, log_probability, memory)
            reward, last = expected_reward(
                outputs.utility, outputs.stay, true_modes, self.world.change_cost, last
            )
            entropy = nn.functional.cross_entropy(outputs.belief.flatten(0, 1), true_modes.flatten())
            loss = self.settings.belief_weight * entropy - reward.mean()
            self.optimizer.zero_grad(set_to_none=False)
            loss.backward()
            nn.utils.clip_grad_norm_(self.net.parameters(), LARGEST_GRADIENT)
            self.optimizer.step()
            memory, last = outputs.memory.detach(), last.detach()
            totals += float(reward.detach().mean()), float(entropy.detach())
        mean: NDArray[np.float64] = totals / len(pieces)
        return float(mean[0]), float(mean[1])

    def family(self, name: str) -> DeciderFamily:
        """Return the current agent as a family of deciders for the environment of the run."""
        return statement_net_family(name, self.net, self.world)

    def save_agent(self, folder: Path, card: dict[str, Any]) -> None:
        """Write weights and card of the current agent."""
        save_policy(folder, self.net.state_dict(), card, QuickestLayout)


def simulate(
    world: QuickestOptions, tracks: int, seed: int
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.int64]]:
    """Return inputs (T, N, M - 1, 26), log-probabilities (T, N, M) and true modes (T, N) of one episode each.

    Args:
        world: options of the environment.
        tracks: N.
        seed: of the first track.
    """
    env = HybridTrackQuickestVectorEnv(tracks, autoreset_mode="Disabled", tick_info=False, **vars(world))
    rows, _ = env.reset(seed=seed)
    all_rows = np.empty((world.ticks, *rows.shape), np.float32)
    true_modes, ages = (np.empty((world.ticks, tracks), np.int64) for _ in range(2))
    layout = QuickestLayout(world.hypotheses)
    block = layout.slices["log_probability"]
    best, age, statement = np.full(tracks, -1), np.zeros(tracks, np.int64), np.zeros(tracks, np.int64)
    for tick in range(world.ticks):
        all_rows[tick], true_modes[tick] = rows, env.world.field("true_mode")
        previous, best = best, rows[:, block].argmax(-1)
        ages[tick] = age = count_ages(best, previous, age)
        rows, *_ = env.step(statement)  # statements change only columns that the network does not read
    log_probability = np.asarray(all_rows[..., block] / layout.scales["log_probability"], np.float32)
    return statement_inputs(world, all_rows, ages), log_probability, true_modes
