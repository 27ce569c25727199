"""The scores of a decider: values of every episode at every threshold, and what follows from them.
Every result is a function of means over episodes, a `Statistic`. One bootstrap over episodes gives
its confidence interval, and the paired interval of a difference between two deciders on the same
episodes.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from baselines.scoring.estimates import Estimate, confidence_interval, wilson_interval
from hybrid_env.checks import AnyArray, FloatArray

# Finite, because a difference of infinities would be NaN.
NOT_REACHED = 1e9


@dataclass(frozen=True)
class Statistic:
    """A function of means over episodes."""

    # Names of the values that it needs, see `Scores`.
    columns: tuple[str, ...]
    # From the means of these values, (..., K) each, to (..., K), or to (...) if it reads the whole
    # operating curve; `NOT_REACHED` stands for infinity, NaN for nothing counted.
    function: Callable[..., FloatArray]
    # True of a mean share, whose interval is Wilson's if all episodes have the share 0 or 1.
    share: bool = False


def mean(column: str, share: bool = False) -> Statistic:
    """Return the mean of a value over episodes."""
    return Statistic((column,), lambda means: means, share)


def ratio(numerator: str, denominator: str, factor: float = 1.0) -> Statistic:
    """Return the quotient of two means, times a factor; NaN where the denominator is 0."""
    return Statistic((numerator, denominator), lambda a, b: factor * quotient(a, b))


def quotient(numerator: FloatArray, denominator: FloatArray) -> FloatArray:
    """Return numerator / denominator, NaN where the denominator is not positive."""
    positive = denominator > 0.0
    return np.where(positive, numerator / np.where(positive, denominator, 1.0), np.nan)


def at_level(measure: str, level: float, statistic: Statistic, falling: bool = False) -> Statistic:
    """Return a statistic where the operating curve first reaches a level of a value, or falls to
    it if `falling`, by linear interpolation between thresholds; `NOT_REACHED` beyond the level.
    """
    sign = -1.0 if falling else 1.0

    def function(means: FloatArray, *others: FloatArray) -> FloatArray:
        curve = sign * means
        values = statistic.function(*others)
        reached = curve >= sign * level
        right = reached.argmax(-1)[..., None]
        (x0, y0), (x1, y1) = (
            [np.take_along_axis(line, index, -1)[..., 0] for line in (curve, values)]
            for index in (np.maximum(right - 1, 0), right)
        )
        step = x1 - x0
        fraction = np.where(step > 0, (sign * level - x0) / np.where(step > 0, step, 1.0), 1.0)
        return np.where(reached.any(-1), y0 + fraction * (y1 - y0), NOT_REACHED)

    return Statistic((measure, *statistic.columns), function)


def interpolated(measure: str, level: float, column: str) -> Statistic:
    """Return the mean of a value where the mean of another, which rises with the thresholds, has a
    level: linear between thresholds, and constant beyond them.
    """

    def function(means: FloatArray, values: FloatArray) -> FloatArray:
        pairs = zip(
            means.reshape(-1, means.shape[-1]), values.reshape(-1, means.shape[-1]), strict=True
        )
        return np.array([np.interp(level, *pair) for pair in pairs]).reshape(means.shape[:-1])

    return Statistic((measure, column), function, share=True)


@dataclass(frozen=True)
class Scores:
    """Values of one decider on E episodes at K thresholds."""

    # Name of the decider in tables.
    name: str
    # Symbol of its threshold.
    symbol: str
    # K thresholds.
    thresholds: tuple[float, ...]
    # Names of F values.
    columns: tuple[str, ...]
    # (E, F, K) values.
    values: FloatArray
    # (K, ...) by name, what is no mean over episodes.
    extra: Mapping[str, AnyArray] = field(default_factory=dict)
    # That the decider reads, for tables; empty where all environments have the same.
    bank: str = ""

    @property
    def episodes(self) -> int:
        """Number E of episodes."""
        return len(self.values)

    def of(self, column: str, index: int) -> FloatArray:
        """Return a value of each episode at one threshold, (E,)."""
        return self.values[:, self.columns.index(column), index]

    def at(self, index: int) -> "Scores":
        """Return the scores of a single threshold."""
        return replace(
            self,
            thresholds=(self.thresholds[index],),
            values=np.ascontiguousarray(self.values[..., index, None]),
            extra={name: array[index, None] for name, array in self.extra.items()},
        )

    def some(self, episodes: Sequence[int]) -> "Scores":
        """Return the scores on some of the episodes, without `extra`."""
        return replace(self, values=self.values[list(episodes)], extra={})

    def curve(self, statistic: Statistic) -> FloatArray:
        """Return a statistic at every threshold, (K,), or a number if it depends on the whole
        curve.
        """
        return statistic.function(*np.moveaxis(self._rows(statistic).mean(0), -2, 0))

    def estimate(self, statistic: Statistic, index: int | None = None) -> Estimate:
        """Return a statistic with its confidence interval at the threshold of an index, or of
        the whole curve.
        """
        rows = self._rows(statistic, index)
        estimate = _estimate(rows, lambda means: _number(statistic, means))
        if statistic.share and estimate.low == estimate.high and estimate.value in (0.0, 1.0):
            return Estimate(estimate.value, *wilson_interval(estimate.value, len(rows)))
        return estimate

    def difference(
        self,
        other: "Scores",
        statistic: Statistic,
        index: int | None = None,
        of_other: int | None = None,
        combine: Callable[[FloatArray, FloatArray], FloatArray] = np.subtract,
    ) -> Estimate:
        """Return the difference self - other on the same episodes, or another function, with its
        paired interval; `index` and `of_other` are of the thresholds, see `estimate`.
        """
        mine = self._rows(statistic, index)
        theirs = other._rows(statistic, of_other)
        split = mine.shape[-1]

        def of_means(means: FloatArray) -> Any:
            parts = means[..., :split], means[..., split:]
            return combine(*(_number(statistic, part) for part in parts))

        return _estimate(np.concatenate([mine, theirs], axis=-1), of_means)

    def ratio(self, other: "Scores", statistic: Statistic) -> Estimate:
        """Return the quotient self / other of a statistic of the whole curve; infinite where one
        is not reached.
        """

        def divide(mine: FloatArray, theirs: FloatArray) -> FloatArray:
            return np.where(
                np.maximum(mine, theirs) < NOT_REACHED, quotient(mine, theirs), NOT_REACHED
            )

        return self.difference(other, statistic, combine=divide)

    def _rows(self, statistic: Statistic, index: int | None = None) -> FloatArray:
        """Return the values that a statistic needs, (E, columns, thresholds)."""
        rows = self.values[:, [self.columns.index(name) for name in statistic.columns]]
        return rows if index is None else rows[..., index, None]


def _number(statistic: Statistic, means: FloatArray) -> FloatArray:
    """Return a statistic of the whole curve, or of a single threshold, (...)."""
    value = statistic.function(*np.moveaxis(means, -2, 0))
    return value if value.ndim == means.ndim - 2 else value[..., 0]


def _estimate(episodes: FloatArray, of_means: Callable[[FloatArray], Any]) -> Estimate:
    numbers = float(of_means(episodes.mean(0))), *confidence_interval(episodes, of_means=of_means)
    return Estimate(
        *(
            math.copysign(math.inf, number) if abs(number) > NOT_REACHED / 2 else number
            for number in numbers
        )
    )
