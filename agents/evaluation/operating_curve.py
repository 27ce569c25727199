"""The operating curve of a decider: accuracy, decision time and reward as functions of its threshold.

All statistics are functions of means over episodes. One bootstrap over episodes gives their confidence
intervals, and paired intervals for differences between two deciders on the same episodes.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.evaluation.deciders import DeciderFamily
from agents.evaluation.evaluate import Decisions, confidence_interval, evaluate, share_interval

FloatArray = NDArray[np.float64]
ACCURACY, TICKS, REWARD = 0, 1, 2
NOT_REACHED = 1e9  # ticks; finite, because a difference of infinities would be NaN


@dataclass(frozen=True)
class Estimate:
    """A point estimate with its 95 % confidence interval; infinite where an accuracy is not reached.

    Attributes:
        value: point estimate.
        low, high: bounds of the confidence interval.
    """

    value: float
    low: float
    high: float

    def as_json(self) -> dict[str, float | None]:
        """Return finite numbers, and None for infinite ones."""
        return {
            name: number if np.isfinite(number) else None
            for name, number in (("value", self.value), ("low", self.low), ("high", self.high))
        }


@dataclass(frozen=True)
class OperatingCurve:
    """Decisions of one decider at every threshold, on the same episodes.

    Attributes:
        family: of the decider.
        decisions: one item per threshold.
    """

    family: DeciderFamily
    decisions: tuple[Decisions, ...]

    @property
    def episodes(self) -> FloatArray:
        """Mean accuracy, ticks and reward of each episode, (E, 3, thresholds)."""
        rows = [[d.correct.mean(1), d.ticks.mean(1), d.reward.mean(1)] for d in self.decisions]
        return np.moveaxis(np.array(rows), -1, 0).swapaxes(1, 2)

    @property
    def means(self) -> FloatArray:
        """Mean accuracy, ticks and reward, (3, thresholds)."""
        return self.episodes.mean(0)

    def best_index(self) -> int:
        """Return the index of the threshold with the largest mean reward."""
        return int(self.means[REWARD].argmax())

    def fastest_index(self, accuracy: float) -> int:
        """Return the index of the threshold with the smallest mean decision time at a required accuracy.

        If no threshold reaches the accuracy, return the most accurate one.
        """
        reached, ticks = self.means[ACCURACY] >= accuracy, self.means[TICKS]
        if not reached.any():
            return int(self.means[ACCURACY].argmax())
        return int(np.where(reached, ticks, np.inf).argmin())

    def estimate(self, statistic: Callable[[FloatArray], Any]) -> Estimate:
        """Return a function of the means (..., 3, thresholds) with its confidence interval."""
        return estimate(self.episodes, statistic)

    def estimate_share(self, statistic: Callable[[FloatArray], Any]) -> Estimate:
        """Return an accuracy or error rate as `estimate`, also if all decisions are right, or all wrong."""
        found = self.estimate(statistic)
        if found.low == found.high and found.value in (0.0, 1.0):
            return Estimate(found.value, *share_interval(np.full(len(self.episodes), found.value)))
        return found

    def difference(
        self, other: "OperatingCurve", statistic: Callable[[FloatArray], Any], of_other: Any = None
    ) -> Estimate:
        """Return statistic(self) - statistic(other) on the same episodes, with its paired interval.

        Args:
            other: curve on the same episodes.
            statistic: function of the means (..., 3, thresholds).
            of_other: statistic of the other curve, if it differs.
        """
        return paired_estimate(
            self.episodes,
            other.episodes,
            lambda mine, theirs: statistic(mine) - (of_other or statistic)(theirs),
        )


def estimate(episodes: FloatArray, statistic: Callable[[FloatArray], Any]) -> Estimate:
    """Return a function of means over episodes with its confidence interval.

    Args:
        episodes: (E, F, thresholds) figures of each episode.
        statistic: number (...) from means (..., F, thresholds).
    """
    flat = episodes.reshape(len(episodes), -1)

    def of_means(means: FloatArray) -> Any:
        return statistic(means.reshape(*means.shape[:-1], *episodes.shape[1:]))

    return _estimate(flat, of_means)


def paired_estimate(
    mine: FloatArray, theirs: FloatArray, statistic: Callable[[FloatArray, FloatArray], Any]
) -> Estimate:
    """Return a function of the means of two deciders with its paired confidence interval.

    Args:
        mine, theirs: (E, F, thresholds) figures of each of the same episodes; F and the thresholds may
            differ.
        statistic: number (...) from the means of both, (..., F, thresholds).
    """
    split = mine[0].size
    flat = np.concatenate([mine.reshape(len(mine), -1), theirs.reshape(len(theirs), -1)], axis=1)

    def of_means(means: FloatArray) -> Any:
        first = means[..., :split].reshape(*means.shape[:-1], *mine.shape[1:])
        second = means[..., split:].reshape(*means.shape[:-1], *theirs.shape[1:])
        return statistic(first, second)

    return _estimate(flat, of_means)


def _estimate(episodes: FloatArray, of_means: Callable[[FloatArray], Any]) -> Estimate:
    numbers = float(of_means(episodes.mean(0))), *confidence_interval(episodes, of_means=of_means)
    value, low, high = (
        math.copysign(math.inf, number) if abs(number) > NOT_REACHED / 2 else number for number in numbers
    )
    return Estimate(value, low, high)


def at_threshold(row: int, index: int) -> Callable[[FloatArray], FloatArray]:
    """Return the statistic "accuracy, ticks or reward at one threshold"."""
    return lambda means: means[..., row, index]


def ticks_at_accuracy(level: float) -> Callable[[FloatArray], FloatArray]:
    """Return the statistic "mean decision time at which the curve first reaches an accuracy".

    The curve is interpolated linearly between thresholds. The value is `NOT_REACHED` below the accuracy.
    """
    return lambda means: value_at_level(means[..., ACCURACY, :], level, means[..., TICKS, :])


def value_at_level(measure: FloatArray, level: float, values: FloatArray) -> FloatArray:
    """Return values (...) at the first threshold at which a measure reaches a level.

    They are interpolated linearly from the threshold before; the value is `NOT_REACHED` below the level.

    Args:
        measure, values: (..., thresholds).
        level: of the measure.
    """
    reached = measure >= level
    right = reached.argmax(-1)
    left = np.maximum(right - 1, 0)

    def pick(values: FloatArray, index: NDArray[np.int64]) -> FloatArray:
        return np.take_along_axis(values, index[..., None], -1)[..., 0]

    step = pick(measure, right) - pick(measure, left)
    fraction = np.where(step > 0, (level - pick(measure, left)) / np.where(step > 0, step, 1.0), 1.0)
    crossing = pick(values, left) + fraction * (pick(values, right) - pick(values, left))
    return np.where(reached.any(-1), crossing, NOT_REACHED)


def error_at_ticks(time: float) -> Callable[[FloatArray], FloatArray]:
    """Return the statistic "error probability at a mean decision time".

    The curve is interpolated linearly between thresholds and extrapolated with its first and last values.
    """

    def statistic(means: FloatArray) -> FloatArray:
        flat = means.reshape(-1, *means.shape[-2:])
        errors = [np.interp(time, one[TICKS], 1.0 - one[ACCURACY]) for one in flat]
        return np.array(errors).reshape(means.shape[:-2])

    return statistic


def sweep(
    family: DeciderFamily,
    env_id: str,
    episodes: int,
    seed: int,
    on_progress: Callable[[], None] | None = None,
    thresholds: Sequence[float] | None = None,
    **options: Any,
) -> OperatingCurve:
    """Evaluate a decider at each threshold on the same episodes.

    Args:
        family: of the decider.
        env_id: registered id.
        episodes: number of episodes.
        seed: of the first episode.
        on_progress: called after each threshold.
        thresholds: to use instead of those of the family.
        options: environment options that override those of the id.
    """
    decisions = []
    options |= family.options
    for threshold in family.thresholds if thresholds is None else thresholds:
        decisions.append(evaluate(family.make(threshold), env_id, episodes, seed, **options))
        if on_progress is not None:
            on_progress()
    return OperatingCurve(family, tuple(decisions))
