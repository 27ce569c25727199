"""The operating curve of a decider of `HybridTrackQuickest-v0`: metrics of its statements at every threshold.

Tracks are independent, so that all intervals are bootstrapped over whole tracks; see `operating_curve`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.evaluation.deciders import DeciderFamily
from agents.evaluation.operating_curve import NOT_REACHED, Estimate, estimate, paired_estimate, value_at_level
from baselines.rules.beam import BeamDecider
from baselines.rules.decider import Actions
from baselines.rules.metrics import measure_statements
from baselines.rules.statements import Statements, record_statements
from hybrid_env.checks import check_integer
from hybrid_env.quickest_options import QuickestOptions

FloatArray = NDArray[np.float64]
LARGEST_BATCH = 1_000_000  # statements, which need about 200 MB with 20 thresholds
LARGEST_RESULT = 100_000_000  # statements of one threshold
MOST_SEGMENTS = 2_000_000  # expected number on all tracks; every threshold stores their delays
UNDEFINED = 1e18  # ticks; finite, because a difference of infinities would be NaN, and `_estimate` shows inf

ROWS = (
    "right", "reward", "wrong_changes", "stated_changes", "switches", "delay", "detected", "missed",
    "undetected",
)  # fmt: skip
RIGHT, REWARD, WRONG_CHANGES, STATED_CHANGES, SWITCHES, DELAY, DETECTED, MISSED, UNDETECTED = range(9)
"""Rows of the figures of a track: two shares of ticks, then changes per 1,000 ticks, then sums over ticks."""


@dataclass(frozen=True)
class TrackMetrics:
    """Metrics of a decider at one threshold on N tracks.

    Attributes:
        rows: (N, 9) figures of each track, see `ROWS`. "delay" is the sum of the delays of the detected
            switches, "undetected" the number of ticks after a switch on which the new mode has not been
            stated yet; both in ticks.
        delays: (D,) delays of the detected switches [ticks], in any order.
    """

    rows: FloatArray
    delays: NDArray[np.int64]


@dataclass(frozen=True)
class Statistic:
    """A function of means over tracks.

    Attributes:
        rows: of the figures that it needs, see `ROWS`.
        function: from the means of these rows, (..., thresholds) each.
    """

    rows: tuple[int, ...]
    function: Callable[..., FloatArray]

    def of_means(self, means: FloatArray) -> FloatArray:
        """Return the statistic from the means of its rows, (..., rows, thresholds)."""
        return self.function(*np.moveaxis(means, -2, 0))


@dataclass(frozen=True)
class StatementCurve:
    """Metrics of one decider at every threshold, on the same N tracks.

    Attributes:
        family: of the decider.
        metrics: one item per threshold.
    """

    family: DeciderFamily
    metrics: tuple[TrackMetrics, ...]

    @cached_property
    def tracks(self) -> FloatArray:
        """Figures of each track, (N, 9, thresholds)."""
        return np.stack([one.rows for one in self.metrics], axis=-1)

    def values(self, statistic: Statistic) -> FloatArray:
        """Return a statistic of the tracks, at every threshold where it depends on the threshold."""
        return statistic.of_means(self.tracks[:, statistic.rows].mean(0))

    def best_index(self) -> int:
        """Return the index of the threshold with the largest mean reward."""
        return int(self.values(mean_of(REWARD)).argmax())

    def at(self, index: int) -> "StatementCurve":
        """Return the curve of a single threshold."""
        family = replace(self.family, thresholds=(self.family.thresholds[index],))
        return StatementCurve(family, (self.metrics[index],))

    def estimate(self, statistic: Statistic) -> Estimate:
        """Return a statistic with its confidence interval; the curve of a single threshold for most."""
        return estimate(self.tracks[:, statistic.rows], lambda means: _number(statistic, means))

    def difference(self, other: "StatementCurve", statistic: Statistic) -> Estimate:
        """Return the difference of a statistic on the same tracks, self - other, with its paired interval."""
        return self._paired(other, statistic, lambda mine, theirs: mine - theirs)

    def ratio(self, other: "StatementCurve", statistic: Statistic) -> Estimate:
        """Return the ratio of a statistic on the same tracks, self / other, with its paired interval.

        It is infinite where one of the two curves does not reach the statistic.
        """

        def divide(mine: FloatArray, theirs: FloatArray) -> FloatArray:
            reached = np.maximum(mine, theirs) < NOT_REACHED
            return np.where(reached, _divide(mine, theirs), UNDEFINED)

        return self._paired(other, statistic, divide)

    def _paired(
        self,
        other: "StatementCurve",
        statistic: Statistic,
        combine: Callable[[FloatArray, FloatArray], FloatArray],
    ) -> Estimate:
        mine, theirs = (curve.tracks[:, statistic.rows] for curve in (self, other))
        return paired_estimate(
            mine, theirs, lambda *means: combine(*(_number(statistic, one) for one in means))
        )


def _number(statistic: Statistic, means: FloatArray) -> FloatArray:
    """A statistic that does not depend on the threshold, or is of a single one, (...)."""
    value = statistic.of_means(means)
    return value if value.ndim == means.ndim - 2 else value[..., 0]


def _divide(numerator: FloatArray, denominator: FloatArray) -> FloatArray:
    """The quotient; `UNDEFINED` for a denominator of 0."""
    positive = denominator > 0.0
    return np.where(positive, numerator / np.where(positive, denominator, 1.0), UNDEFINED)


def mean_of(row: int) -> Statistic:
    """Return the statistic "mean of a row over tracks"."""
    return Statistic((row,), lambda means: means)


MEAN_DELAY = Statistic((DELAY, DETECTED), _divide)
"""Mean delay of the detected switches [ticks]."""
FULL_DELAY = Statistic((UNDETECTED, SWITCHES), _divide)
"""Mean delay of all switches [ticks]; one that is not detected counts until the end of its segment."""
MISSED_SHARE = Statistic((MISSED, DETECTED), lambda missed, detected: _divide(missed, missed + detected))
"""Share of missed switches, as `baselines.rules.metrics.StatementMetrics.missed_share`."""
CHANGE_RATIO = Statistic((STATED_CHANGES, SWITCHES), _divide)
"""Changes of the statement per switch."""


def at_wrong_changes(rate: float, statistic: Statistic) -> Statistic:
    """Return a statistic at a rate of wrong changes, interpolated linearly between thresholds.

    The curve is followed from the first threshold on, which has the most wrong changes, to the point at which
    it has no more than this rate. If it has fewer from the beginning, the value is that of the first one.

    Args:
        rate: wrong changes per 1,000 ticks.
        statistic: at every threshold.
    """
    return Statistic(
        (WRONG_CHANGES, *statistic.rows),
        lambda wrong, *means: value_at_level(-wrong, -rate, statistic.function(*means)),
    )


def sweep_statements(
    family: DeciderFamily,
    options: QuickestOptions,
    tracks: int,
    seed: int,
    on_progress: Callable[[float], None] | None = None,
) -> StatementCurve:
    """Evaluate a decider at each threshold on the same tracks.

    Args:
        family: of the decider.
        options: of the environment.
        tracks: N, number of tracks of one episode each.
        seed: of the first track.
        on_progress: called repeatedly with the finished share.

    Raises:
        ArgumentError: so many tracks that their statements would fill the memory.
    """
    check_tracks("episodes", tracks, options)
    size = max(1, LARGEST_BATCH // options.ticks)
    deciders = [family.make(threshold) for threshold in family.thresholds]
    batches: list[list[TrackMetrics]] = []
    for first in range(0, tracks, size):
        count = min(size, tracks - first)
        found: list[TrackMetrics] = []
        for group in _sharing(deciders):
            found += [
                track_metrics(statements, options.change_cost)
                for statements in _record(group, options, count, seed + first)
            ]
            if on_progress is not None:
                on_progress((first + count * len(found) / len(deciders)) / tracks)
        batches.append(found)
    return joined_tracks(family, batches)


def joined_tracks(family: DeciderFamily, batches: Sequence[Sequence[TrackMetrics]]) -> StatementCurve:
    """Return the curve of all tracks from the metrics of some of them at every threshold."""
    return StatementCurve(
        family,
        tuple(
            TrackMetrics(np.concatenate([p.rows for p in parts]), np.concatenate([p.delays for p in parts]))
            for parts in zip(*batches, strict=True)
        ),
    )


def check_tracks(name: str, tracks: int, options: QuickestOptions) -> None:
    """Raise `ArgumentError` for so many tracks that their statements or delays would fill the memory.

    Args:
        name: of the argument.
        tracks: number of tracks of one episode each.
        options: of the environment.
    """
    segments = options.ticks / min(options.law.mean_duration, options.ticks)
    largest = max(1, int(min(LARGEST_RESULT / options.ticks, MOST_SEGMENTS / segments)))
    check_integer(name, tracks, maximum=largest)


def track_metrics(statements: Statements, change_cost: float) -> TrackMetrics:
    """Return the metrics of each track, see `measure_statements`."""
    metrics = measure_statements(statements, change_cost)
    tracks = len(metrics.right)
    rows = np.empty((tracks, len(ROWS)))
    rows[:, RIGHT], rows[:, REWARD] = metrics.right, metrics.reward
    rows[:, WRONG_CHANGES], rows[:, STATED_CHANGES] = metrics.wrong_changes, metrics.stated_changes
    rows[:, SWITCHES], rows[:, MISSED] = metrics.true_changes, metrics.missed
    rows[:, DELAY] = np.bincount(metrics.delay_tracks, metrics.delays, tracks)
    rows[:, DETECTED] = np.bincount(metrics.delay_tracks, minlength=tracks)
    rows[:, UNDETECTED] = undetected_ticks(statements)
    return TrackMetrics(rows, metrics.delays)


def undetected_ticks(statements: Statements) -> NDArray[np.int64]:
    """Return the number of ticks after a switch before the new mode is stated first, (N,).

    A switch that is not detected counts until the next one, or until the end of the track.
    """
    true, stated = statements
    times = np.arange(len(true))[:, None]
    switched = np.diff(true, axis=0, prepend=true[:1]) != 0
    last_switch, last_right = (
        np.maximum.accumulate(np.where(flags, times, -1), axis=0) for flags in (switched, true == stated)
    )
    return np.asarray((last_right < last_switch).sum(0))


def _sharing(deciders: Sequence[Any]) -> list[list[Any]]:
    """Return groups of deciders of one family that can be recorded together."""
    if all(isinstance(decider, BeamDecider) for decider in deciders):
        return [list(deciders)]
    return [[decider] for decider in deciders]


def _record(deciders: Sequence[Any], options: QuickestOptions, tracks: int, seed: int) -> list[Statements]:
    if len(deciders) == 1:
        return [record_statements(deciders[0], tracks, seed, **vars(options))]
    several: Any = SeveralThresholds(deciders)
    true_modes, _ = record_statements(several, tracks, seed, **vars(options))
    return [Statements(true_modes, np.array(stated)) for stated in several.stated]


class SeveralThresholds:
    """Beams that differ in their thresholds only, computed once; it states what the first of them states.

    The posterior of a beam does not depend on what it states.

    Args:
        beams: deciders with the same model.

    Attributes:
        stated: for every beam, the statements (N,) at each tick so far.
    """

    def __init__(self, beams: Sequence[BeamDecider]):
        self.beam, self.rules = beams[0], [beam.rule for beam in beams]
        self.observe = self.beam.observe
        self.stated: list[list[Actions]] = [[] for _ in beams]

    def predict(
        self, observation: FloatArray, state: Any, episode_start: Any, deterministic: bool = True
    ) -> tuple[Actions, Any]:
        """See `BeamDecider.predict`."""
        _, state = self.beam.predict(observation, state, episode_start, deterministic)
        for rule, statements in zip(self.rules, self.stated, strict=True):
            last = statements[-1] if statements else np.zeros(len(observation), np.int64)
            statements.append(rule.choose(state.log_probability, last, ~np.asarray(episode_start)))
        return self.stated[0][-1], state
