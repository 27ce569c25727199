"""Agents that state a mode at every tick, trained on simulated tracks.

A round is determined by its number, so that a checkpoint between two rounds needs no other state
than the network and its optimizer.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar

import numpy as np
import torch
from annotated_types import Ge, MinLen
from numpy.typing import NDArray

from agents import StatementDecider, UtilityDecider, statement_inputs, task_of
from hybrid_env import ArgumentError, HybridTrackQuickestVectorEnv, QuickestOptions
from studies.shipped.expected_reward import (
    ExpectedRewardAlgorithm,
    ExpectedRewardSettings,
    StatementBatch,
)
from studies.shipped.random_worlds import log_uniform

Count = Annotated[int, Ge(1)]
# The law of an object whose habits are drawn anew in every episode.
DRAWN = "drawn"


@dataclass(frozen=True, kw_only=True)
class StatementSettings(ExpectedRewardSettings):
    """Hyper-parameters of the agent for unknown switch moments, trained on new tracks in every
    round.
    """

    # Laws of segments, one environment of every round for each, also repeated.
    durations: Annotated[tuple[str, ...], MinLen(1)]
    # Tracks of each environment.
    n_envs: Count
    # Tracks of an update.
    batch_size: Count
    # Bounds of a factor of the measurement variance of the environment.
    variances: tuple[float, float] = (1.0, 1.0)
    # Likewise of its radii.
    radii: tuple[float, float] = (1.0, 1.0)
    # Length of the tracks; None is that of the environment.
    ticks: Count | None = None
    # Whether the agent has a beam that learns the habits of an object within the episode.
    habits: bool = False


class Statements(ExpectedRewardAlgorithm):
    """A training run of an agent that states a mode at every tick, on simulated tracks; it refuses
    an environment in which modes are not stated.
    """

    Settings: ClassVar[type[StatementSettings]] = StatementSettings
    decider: ClassVar[type[UtilityDecider]] = StatementDecider
    smallest_factor: ClassVar[float] = 0.01
    settings: StatementSettings

    @property
    def worlds_count(self) -> int:
        """Number of environments of a round."""
        return len(self.settings.durations)

    @property
    def ticks(self) -> int:
        """Length of the tracks."""
        return self.settings.ticks or self.world.ticks

    def make_env(self, world: QuickestOptions, tracks: int) -> Any:
        """Return an environment of a round."""
        options = {**vars(world), "decide_every": 1}
        return HybridTrackQuickestVectorEnv(tracks, "Disabled", tick_info=False, **options)

    def simulate(self, world: QuickestOptions, tracks: int, seed: int) -> tuple[NDArray[Any], ...]:
        """Return inputs (T, N, M - 1, k), log-probabilities (T, N, M) and true modes (T, N) of one
        episode of each track.
        """
        decider = StatementDecider(self.network, world)
        env = self.make_env(world, tracks)
        rows, _ = env.reset(seed=seed)
        state = decider.initial_state(tracks)
        parts = []
        logs = []
        modes = []
        for _ in range(world.ticks):
            if decider.beam is not None:
                rows = np.hstack([rows, decider.beam.observe(env.world)])
            features, log_probability, state = decider.features(rows, state, None)
            parts.append(features)
            logs.append(log_probability)
            modes.append(env.world.field("true_mode"))
            # Statements change only columns that the network does not read.
            rows, *_ = env.step(np.zeros(tracks, np.int64))
        arrays = (np.stack(part) for part in zip(*parts, strict=True))
        return statement_inputs(world, *arrays), np.stack(logs), np.stack(modes)

    def prepare(self) -> None:
        task = task_of(self.env_id, self.options)
        if task.switches != self.decider.task:
            raise ArgumentError(f"env={self.env_id}: expected one in which modes are stated")
        self.world: QuickestOptions = task.options
        self._round_tracks = self.worlds_count * self.settings.n_envs
        self.round_steps = self._round_tracks * self.ticks

    def batches(self) -> Iterator[StatementBatch]:
        """Simulate the tracks of a round, and divide them at random."""
        first = 10**12 + self.seed * 10**9 + self.rounds * self._round_tracks
        generator = np.random.default_rng(first)
        count = self.settings.n_envs
        parts = [
            self.simulate(self.draw_world(generator, k), count, first + k * count)
            for k in range(self.worlds_count)
        ]
        arrays = [
            torch.from_numpy(np.concatenate(part, axis=1)) for part in zip(*parts, strict=True)
        ]
        order = generator.permutation(self._round_tracks)
        for start in range(0, len(order), self.settings.batch_size):
            inputs, logs, modes = (
                array[:, order[start : start + self.settings.batch_size]] for array in arrays
            )
            costs = torch.full(modes.shape, self.world.change_cost)
            yield StatementBatch(inputs, logs, modes, costs, torch.ones(modes.shape))

    def draw_world(self, generator: np.random.Generator, number: int) -> QuickestOptions:
        """Return the options of an environment of a round, by its number in the round."""
        law = self.settings.durations[number]
        variance, radius = (
            log_uniform(generator, min(factors), max(factors))
            for factors in (self.settings.variances, self.settings.radii)
        )
        variances = tuple(variance * self.world.variances)
        habits: dict[str, Any] = {"durations": law}
        # The bank's hazard follows from the law, which is then unknown.
        if law == DRAWN:
            hazard = float(log_uniform(generator, 1 / 160, 1 / 30))
            habits |= {
                "transitions": DRAWN,
                "hazard": min(hazard, 1.0 - 1.0 / self.world.hypotheses),
            }
        return replace(
            self.world,
            **habits,
            ticks=self.ticks,
            measurement_variance=variances if len(variances) == 2 else variances[0],
            radii=tuple(radius * np.array(self.world.radii)),
        )
