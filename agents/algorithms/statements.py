"""Agents that state a mode at every tick, trained on simulated tracks.

A round is determined by its number, so that a checkpoint between two rounds needs no other state
than the network and its optimizer.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from agents.evaluation.task import task_of
from agents.learned.statement_decider import StatementDecider, UtilityDecider
from agents.learned.statement_net import statement_inputs
from agents.training.expected_reward import (
    ExpectedRewardAlgorithm,
    ExpectedRewardSettings,
    StatementBatch,
)
from agents.training.inexact import draw_options, inexact_travel
from agents.training.settings import Factors
from baselines.recordings.given_tracks import GivenTracks
from baselines.recordings.log_uniform import log_uniform
from baselines.rules import seeds
from baselines.rules.rollout import statement_env
from hybrid_env.checks import Count, NotNegative, reject
from hybrid_env.durations import DRAWN, parse_durations
from hybrid_env.limits import Ticks
from hybrid_env.quickest_options import QuickestOptions


def law_text(value: Any, name: str) -> str:
    """Return the text of a law of the durations."""
    return str(parse_durations(value, name))


@dataclass(frozen=True, kw_only=True)
class StatementSettings(ExpectedRewardSettings):
    """Hyper-parameters of the agent for unknown switch moments, trained on new tracks in every
    round.
    """

    # Laws of segments, one environment of every round for each, also repeated.
    durations: tuple[Annotated[str, law_text], ...]
    # Tracks of each environment.
    n_envs: Count
    # Tracks of an update.
    batch_size: Count
    # Smallest and largest factor of the measurement variance of the environment.
    variances: Factors = (1.0, 1.0)
    # Likewise of its radii.
    radii: Factors = (1.0, 1.0)
    # Length of the tracks; None is that of the environment.
    ticks: Ticks | None = None
    # Whether the agent has a beam that learns the habits of an object within the episode.
    habits: bool = False
    # Further environments of every round, in which objects move otherwise than told.
    inexact: NotNegative = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.durations and not self.inexact:
            raise reject("durations", self.durations, "at least one law, or inexact environments")


class Statements(ExpectedRewardAlgorithm):
    """A training run of an agent that states a mode at every tick, on simulated tracks; it refuses
    an environment in which modes are not stated.
    """

    name = "statements"
    Settings = StatementSettings
    decider: ClassVar[type[UtilityDecider]] = StatementDecider
    smallest_factor: ClassVar[float] = 0.01
    settings: StatementSettings

    @classmethod
    def network_of(cls, entry: Mapping[str, Any]) -> nn.Module:
        """See `NetworkAlgorithm.network_of`."""
        if not issubclass(cls.decider, StatementDecider):
            return super().network_of(entry)
        return cls.decider.network(entry["hidden"], entry.get("habits") is True)

    def simulate(
        self,
        world: QuickestOptions,
        tracks: int,
        seed: int,
        inexact: bool,
    ) -> tuple[NDArray[Any], ...]:
        """Return inputs (T, N, M - 1, k), log-probabilities (T, N, M) and true modes (T, N) of one
        episode of each track.

        inexact: objects move otherwise than told, with rows of the likeliest noise.
        """
        decider = StatementDecider(self.net, world)
        env: Any = (
            GivenTracks(inexact_travel, world, tracks, likeliest=True)
            if inexact
            else statement_env(world, tracks)
        )
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
            allowed = "an environment in which a mode is stated at every tick"
            raise reject("env", self.env_id, allowed)
        self.world: QuickestOptions = task.options
        world = self.world
        if self.settings.inexact:
            for name in ("noise", "missed", "sensors", "object_variance", "start"):
                if getattr(world, name) != getattr(QuickestOptions(), name):
                    raise reject(name, getattr(world, name), "the default with the setting inexact")
        self._laws = *self.settings.durations, *([None] * self.settings.inexact)
        self._round_tracks = len(self._laws) * self.settings.n_envs
        self._ticks = world.ticks if self.settings.ticks is None else self.settings.ticks
        self.round_steps = self._round_tracks * self._ticks

    def batches(self) -> Iterator[StatementBatch]:
        """Simulate the tracks of a round, and divide them at random."""
        first = seeds.TRAINING + self.seed * 10**9 + self.rounds * self._round_tracks
        generator = np.random.default_rng(first)
        count = self.settings.n_envs
        parts = [
            self.simulate(self._draw_world(generator, law), count, first + k * count, law is None)
            for k, law in enumerate(self._laws)
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

    def _draw_world(self, generator: np.random.Generator, law: str | None) -> QuickestOptions:
        if law is None:
            return draw_options(generator, replace(self.world, ticks=self._ticks))
        variance, radius = (
            log_uniform(generator, *factors)
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
            ticks=self._ticks,
            measurement_variance=variances if len(variances) == 2 else variances[0],
            radii=tuple(radius * np.array(self.world.radii)),
        )
