"""The operating curve of a decider: accuracy, time and reward as its threshold sweeps.

All figures are functions of means over episodes, so that one bootstrap over episodes gives their intervals,
and of two deciders on the same episodes the interval of their difference.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.evaluation.deciders import DeciderFamily
from agents.evaluation.evaluate import Decisions, evaluate, interval

FloatArray = NDArray[np.float64]
ACCURACY, TICKS, REWARD = 0, 1, 2
NEVER = 1e9  # ticks; a number to calculate on with where infinity would become NaN in a difference


@dataclass(frozen=True)
class Figure:
    """A measured figure with the bounds of its 95 % interval; infinite where it was not reached."""

    value: float
    low: float
    high: float

    def as_json(self) -> dict[str, float | None]:
        """Plain numbers, None where not reached."""
        return {
            name: number if np.isfinite(number) else None
            for name, number in (("value", self.value), ("low", self.low), ("high", self.high))
        }


@dataclass(frozen=True)
class OperatingCurve:
    """Decisions of one family at every threshold, on the same episodes.

    Attributes:
        family: of the decider.
        decisions: one item a threshold.
    """

    family: DeciderFamily
    decisions: tuple[Decisions, ...]

    @property
    def episodes(self) -> FloatArray:
        """(E, 3, thresholds) mean accuracy, ticks and reward of each episode."""
        rows = [[d.correct.mean(1), d.ticks.mean(1), d.reward.mean(1)] for d in self.decisions]
        return np.moveaxis(np.array(rows), -1, 0).swapaxes(1, 2)

    @property
    def means(self) -> FloatArray:
        """(3, thresholds) mean accuracy, ticks and reward."""
        return self.episodes.mean(0)

    def best_index(self) -> int:
        """The threshold of the largest mean reward."""
        return int(self.means[REWARD].argmax())

    def soonest_index(self, accuracy: float) -> int:
        """The threshold that reaches an accuracy soonest, or else the most accurate."""
        reached, ticks = self.means[ACCURACY] >= accuracy, self.means[TICKS]
        if not reached.any():
            return int(self.means[ACCURACY].argmax())
        return int(np.where(reached, ticks, np.inf).argmin())

    def figure(self, statistic: Callable[[FloatArray], Any]) -> Figure:
        """A function of the means (..., 3, thresholds) with its bootstrap interval."""
        episodes = self.episodes
        flat = episodes.reshape(len(episodes), -1)
        return _figure(flat, lambda means: statistic(means.reshape(*means.shape[:-1], *episodes.shape[1:])))

    def difference(
        self, other: "OperatingCurve", statistic: Callable[[FloatArray], Any], of_other: Any = None
    ) -> Figure:
        """statistic(self) - statistic(other) on the same episodes, with its paired interval."""
        mine, theirs = self.episodes, other.episodes
        split = mine[0].size
        flat = np.concatenate([mine.reshape(len(mine), -1), theirs.reshape(len(theirs), -1)], axis=1)

        def of_means(means: FloatArray) -> Any:
            first = means[..., :split].reshape(*means.shape[:-1], *mine.shape[1:])
            second = means[..., split:].reshape(*means.shape[:-1], *theirs.shape[1:])
            return statistic(first) - (of_other or statistic)(second)

        return _figure(flat, of_means)


def _figure(episodes: FloatArray, of_means: Callable[[FloatArray], Any]) -> Figure:
    numbers = float(of_means(episodes.mean(0))), *interval(episodes, of_means=of_means)
    value, low, high = (
        math.copysign(math.inf, number) if abs(number) > NEVER / 2 else number for number in numbers
    )
    return Figure(value, low, high)


def at_threshold(row: int, index: int) -> Callable[[FloatArray], FloatArray]:
    """Accuracy, ticks or reward at one threshold."""
    return lambda means: means[..., row, index]


def ticks_at_accuracy(level: float) -> Callable[[FloatArray], FloatArray]:
    """Mean ticks where the curve first reaches an accuracy, linear between thresholds, or `NEVER`."""

    def statistic(means: FloatArray) -> FloatArray:
        accuracy, ticks = means[..., ACCURACY, :], means[..., TICKS, :]
        reached = accuracy >= level
        right = reached.argmax(-1)
        left = np.maximum(right - 1, 0)

        def pick(values: FloatArray, index: NDArray[np.int64]) -> FloatArray:
            return np.take_along_axis(values, index[..., None], -1)[..., 0]

        step = pick(accuracy, right) - pick(accuracy, left)
        share = np.where(step > 0, (level - pick(accuracy, left)) / np.where(step > 0, step, 1.0), 1.0)
        crossing = pick(ticks, left) + share * (pick(ticks, right) - pick(ticks, left))
        return np.where(reached.any(-1), crossing, NEVER)

    return statistic


def error_at_ticks(time: float) -> Callable[[FloatArray], FloatArray]:
    """Share of wrong decisions at a mean decision time, linear between thresholds.

    Before the curve's first point and behind its last, the error of that point.
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
    """Evaluate a family at each threshold on the same episodes.

    Args:
        on_progress: called after each threshold.
        thresholds: other than the family's own.
        options: of the world, over those of the id.
    """
    decisions = []
    for threshold in family.thresholds if thresholds is None else thresholds:
        decisions.append(evaluate(family.make(threshold), env_id, episodes, seed, **options))
        if on_progress is not None:
            on_progress()
    return OperatingCurve(family, tuple(decisions))
