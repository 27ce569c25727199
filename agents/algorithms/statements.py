"""Agents that state a mode at every tick, trained on simulated tracks.

A round is determined by its number, so that a checkpoint between two rounds needs no other state
than the network and its optimizer.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar

import numpy as np
import torch
from numpy.typing import NDArray

from agents.evaluation.tasks import task_of
from agents.learned.statement_decider import StatementDecider, UtilityDecider
from agents.learned.statement_net import statement_inputs
from agents.training.expected_reward import (
    ExpectedRewardAlgorithm,
    ExpectedRewardSettings,
    StatementBatch,
)
from agents.training.inexact import draw_told, inexact_travel
from agents.training.settings import Factors
from baselines.recordings.given_tracks import GivenTracks
from baselines.recordings.log_uniform import log_uniform
from baselines.rules import seeds
from baselines.rules.rollout import statement_env
from hybrid_env.checks import Count, Float32Array, IntArray, NotNegative, reject
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
    # Further environments of every round, in which objects move otherwise than told.
    inexact: NotNegative = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.durations and not self.inexact:
            raise reject("durations", self.durations, "at least one law, or inexact environments")


class TrackAlgorithm(ExpectedRewardAlgorithm):
    """Base class of the algorithms that train on simulated tracks; it refuses an environment in
    which modes are not stated.
    """

    decider: ClassVar[type[UtilityDecider]]
    smallest_factor: ClassVar[float] = 0.01
    settings: StatementSettings

    def simulate(
        self,
        world: QuickestOptions,
        tracks: int,
        seed: int,
        inexact: bool,
    ) -> tuple[NDArray[Any], ...]:
        """Return inputs, log-probabilities and true modes of one episode of each track; see
        `simulate`.
        """
        assert issubclass(self.decider, StatementDecider)
        return simulate(world, tracks, seed, self.decider(self.net, world), inexact)

    def prepare(self) -> None:
        task = task_of(self.env_id, self.options)
        if task.switches != self.decider.task:
            raise reject(
                "env",
                self.env_id,
                "an environment in which a mode is stated at every tick",
            )
        self.world: QuickestOptions = task.options
        world = self.world
        if self.settings.inexact:
            if self.decider.observes != "rows":
                raise reject(
                    "inexact",
                    self.settings.inexact,
                    "0 for an agent that does not read rows",
                )
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
            return draw_told(generator, replace(self.world, ticks=self._ticks))
        variance, radius = (
            log_uniform(generator, *factors)
            for factors in (self.settings.variances, self.settings.radii)
        )
        variances = tuple(variance * self.world.variances)
        habits: dict[str, Any] = {"durations": law}
        # The bank's hazard follows from the law, which is then unknown.
        if law == DRAWN:
            hazard = float(log_uniform(generator, 1 / 160, 1 / 30))
            habits |= {"order": DRAWN, "hazard": min(hazard, 1.0 - 1.0 / self.world.hypotheses)}
        return replace(
            self.world,
            **habits,
            ticks=self._ticks,
            measurement_variance=variances if len(variances) == 2 else variances[0],
            radii=tuple(radius * np.array(self.world.radii)),
        )


class Statements(TrackAlgorithm):
    """A training run of the statement network on the rows of an environment."""

    name = "statements"
    Settings = StatementSettings
    decider = StatementDecider


def simulate(
    world: QuickestOptions,
    tracks: int,
    seed: int,
    decider: StatementDecider,
    inexact: bool = False,
) -> tuple[Float32Array, Float32Array, IntArray]:
    """Return inputs (T, N, M - 1, k), log-probabilities (T, N, M) and true modes (T, N) of one
    episode each.

    The inputs are those of the network of a decider, which is not used. inexact: objects move
    otherwise than told, with rows of the likeliest noise.
    """
    env: Any = (
        GivenTracks(inexact_travel, world, tracks, likeliest=True)
        if inexact
        else statement_env(world, tracks)
    )
    rows, _ = env.reset(seed=seed)
    all_rows = np.empty((world.ticks, *rows.shape), np.float32)
    log_probability = np.empty((world.ticks, tracks, world.hypotheses), np.float32)
    true_modes, ages = (np.empty((world.ticks, tracks), np.int64) for _ in range(2))
    best = np.full(tracks, -1)
    age = np.zeros(tracks, np.int64)
    statement = np.zeros(tracks, np.int64)
    more: list[Float32Array] = []
    filters = None
    starts = np.zeros(tracks, np.bool_)
    for tick in range(world.ticks):
        all_rows[tick], true_modes[tick] = rows, env.world.field("true_mode")
        _, seen = decider.divide(rows if decider.observes == "rows" else decider.observe(env.world))
        bank = decider.layout.read(rows, "log_probability")
        log_probability[tick], further, filters = decider.filtered(bank, seen, filters, starts)
        if further is not None:
            more.append(further)
        previous, best = best, bank.argmax(-1)
        ages[tick] = age = np.where(best == previous, age + 1, 1)
        # Statements change only columns that the network does not read.
        rows, *_ = env.step(statement)
    inputs = statement_inputs(world, all_rows, ages, np.stack(more) if more else None)
    return inputs, log_probability, true_modes
