"""Agents that state a mode at every tick, trained on simulated tracks.

A round is determined by its number, so that a checkpoint between two rounds needs no other state
than the network and its optimizer.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import torch
from numpy.typing import NDArray

from agents.evaluation.tasks import task_of
from agents.learned.statement_decider import StatementDecider, UtilityDecider
from agents.learned.statement_net import count_ages, statement_inputs
from agents.training.expected_reward import (
    ExpectedRewardAlgorithm,
    ExpectedRewardSettings,
    StatementBatch,
)
from agents.training.inexact import draw_told, inexact_travel
from agents.training.settings import LARGEST_ROUND, two_factors
from baselines.recordings.given_tracks import GivenTracks
from baselines.recordings.log_uniform import log_uniform
from baselines.rules import seeds
from hybrid_env.checks import check_integer, reject
from hybrid_env.durations import DRAWN, parse_durations
from hybrid_env.limits import check_ticks
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.vector_env import HybridTrackQuickestVectorEnv

MOST_LAWS = 100
# Range of the bank's hazard where the law of the durations is drawn.
HAZARDS = 1 / 160, 1 / 30
# Tracks x ticks x turns, whose inputs take half a gigabyte.
LARGEST_INPUTS = 2**22


@dataclass(frozen=True, kw_only=True)
class StatementSettings(ExpectedRewardSettings):
    """Hyper-parameters of the agent for unknown switch moments, trained on new tracks in every
    round.
    """

    # Laws of segments, one environment of every round for each, also repeated.
    durations: tuple[str, ...]
    # Tracks of each environment.
    n_envs: int
    # Tracks of an update.
    batch_size: int
    # Smallest and largest factor of the measurement variance of the environment.
    variances: tuple[float, float] = (1.0, 1.0)
    # Likewise of its radii.
    radii: tuple[float, float] = (1.0, 1.0)
    # Length of the tracks; None is that of the environment.
    ticks: int | None = None
    # Further environments of every round, in which objects move otherwise than told.
    inexact: int = 0

    largest = ExpectedRewardSettings.largest | {
        "n_envs": LARGEST_ROUND,
        "batch_size": LARGEST_ROUND,
    }

    def __post_init__(self) -> None:
        super().__post_init__()
        check_integer("inexact", self.inexact, minimum=0, maximum=MOST_LAWS)
        fewest = 0 if self.inexact else 1
        if (
            not isinstance(self.durations, (list, tuple))
            or not fewest <= len(self.durations) <= MOST_LAWS
        ):
            raise reject("durations", self.durations, f"a list of {fewest} to {MOST_LAWS} laws")
        object.__setattr__(
            self,
            "durations",
            tuple(str(parse_durations(law)) for law in self.durations),
        )
        check_ticks("ticks", 1 if self.ticks is None else self.ticks)
        if self.n_envs * (len(self.durations) + self.inexact) > LARGEST_ROUND:
            raise reject(
                "n_envs",
                self.n_envs,
                f"n_envs x environments of at most {LARGEST_ROUND:,}",
            )
        for name in ("variances", "radii"):
            object.__setattr__(self, name, two_factors(name, getattr(self, name)))


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
        if self._round_tracks * self._ticks * (world.hypotheses - 1) > LARGEST_INPUTS:
            allowed = f"n_envs x environments x ticks x (M - 1) of at most {LARGEST_INPUTS:,}"
            raise reject("n_envs", self.settings.n_envs, allowed)
        self.round_steps = self._round_tracks * self._ticks

    def batches(self) -> Iterator[StatementBatch]:
        """Simulate the tracks of a round, and divide them at random."""
        number = self.num_timesteps // self.round_steps
        first = seeds.TRAINING + self.seed * 10**9 + number * self._round_tracks
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
            hazard = float(log_uniform(generator, *HAZARDS))
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


def make_tracks(world: QuickestOptions, tracks: int, inexact: bool) -> Any:
    """Return a vector environment; `inexact` objects move otherwise than told, with rows of the
    likeliest noise.
    """
    if inexact:
        return GivenTracks(inexact_travel, world, tracks, likeliest=True)
    return HybridTrackQuickestVectorEnv(
        tracks,
        autoreset_mode="Disabled",
        tick_info=False,
        **vars(world),
    )


def simulate(
    world: QuickestOptions,
    tracks: int,
    seed: int,
    decider: StatementDecider | None = None,
    inexact: bool = False,
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.int64]]:
    """Return inputs (T, N, M - 1, k), log-probabilities (T, N, M) and true modes (T, N) of one
    episode each.

    The inputs are those of the network of a decider, by default a `StatementDecider`; the network
    is not used. inexact: whether objects move otherwise than told, see `make_tracks`.
    """
    if decider is None:
        decider = StatementDecider(StatementDecider.network(1), world)
    env = make_tracks(world, tracks, inexact)
    rows, _ = env.reset(seed=seed)
    all_rows = np.empty((world.ticks, *rows.shape), np.float32)
    log_probability = np.empty((world.ticks, tracks, world.hypotheses), np.float32)
    true_modes, ages = (np.empty((world.ticks, tracks), np.int64) for _ in range(2))
    best = np.full(tracks, -1)
    age = np.zeros(tracks, np.int64)
    statement = np.zeros(tracks, np.int64)
    more: list[NDArray[np.float32]] = []
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
        ages[tick] = age = count_ages(best, previous, age)
        # Statements change only columns that the network does not read.
        rows, *_ = env.step(statement)
    inputs = statement_inputs(world, all_rows, ages, np.stack(more) if more else None)
    return inputs, log_probability, true_modes
