"""Training on simulated tracks of an environment with unknown switch moments.

A round is determined by its number, so that a checkpoint between two rounds needs no other state than the
network and its optimizer.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import ClassVar

import numpy as np
import torch
from numpy.typing import NDArray

from agents.evaluation.tasks import task_of
from agents.learned.statement_decider import StatementDecider
from agents.learned.statement_net import count_ages, statement_inputs
from agents.training.settings import StatementSettings
from agents.training.statements import Batch, StatementRun
from baselines.rules import seeds
from hybrid_env.checks import reject
from hybrid_env.observation import QuickestLayout
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.vector_env import HybridTrackQuickestVectorEnv

LARGEST_ROUND = 2**22  # tracks x ticks x turns, whose inputs take half a gigabyte


class TrackRun(StatementRun):
    """A training run on simulated tracks; see `StatementRun`.

    Raises:
        ArgumentError: an environment in which modes are not stated, or a damaged checkpoint.
    """

    decider_class = StatementDecider
    smallest_factor: ClassVar[float] = 0.01

    def prepare(self) -> None:
        """See `StatementRun.prepare`."""
        assert isinstance(self.recipe.settings, StatementSettings)
        self.settings = self.recipe.settings
        task = task_of(self.env_id, self.options)
        if task.switches != self.decider_class.task:
            raise reject("env", self.env_id, "an environment in which a mode is stated at every tick")
        self.world: QuickestOptions = task.options
        world = self.world
        self._round_tracks = len(self.settings.durations) * self.settings.n_envs
        if self._round_tracks * world.ticks * (world.hypotheses - 1) > LARGEST_ROUND:
            allowed = f"n_envs x laws x ticks x (M - 1) of at most {LARGEST_ROUND:,}"
            raise reject("n_envs", self.settings.n_envs, allowed)
        self.round_steps = self._round_tracks * world.ticks

    def batches(self) -> Iterator[Batch]:
        """Simulate the tracks of a round, and divide them at random."""
        number = self.num_timesteps // self.round_steps
        first = seeds.TRAINING + self.seed * 10**9 + number * self._round_tracks
        generator = np.random.default_rng(first)
        parts = [
            simulate(self._draw_world(generator, law), self.settings.n_envs, first + k * self.settings.n_envs)
            for k, law in enumerate(self.settings.durations)
        ]
        arrays = [torch.from_numpy(np.concatenate(part, axis=1)) for part in zip(*parts, strict=True)]
        order = generator.permutation(self._round_tracks)
        for start in range(0, len(order), self.settings.batch_size):
            inputs, logs, modes = (
                array[:, order[start : start + self.settings.batch_size]] for array in arrays
            )
            costs = torch.full(modes.shape, self.world.change_cost)
            yield Batch(inputs, logs, modes, costs, torch.ones(modes.shape))

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
