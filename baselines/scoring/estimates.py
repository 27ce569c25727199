"""Point estimates with confidence intervals over episodes."""

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from hybrid_env.checks import FloatArray, IntArray


@dataclass(frozen=True)
class Estimate:
    """A point estimate with its 95 % confidence interval."""

    # Infinite where a level is not reached, NaN where nothing was counted.
    value: float
    # Bounds of the confidence interval.
    low: float
    high: float

    def as_json(self) -> dict[str, float | None]:
        """Return finite numbers, and None for others."""
        return {
            name: number if np.isfinite(number) else None for name, number in vars(self).items()
        }


def confidence_interval(
    episodes: FloatArray, of_means: Callable[[FloatArray], Any] = lambda means: means
) -> tuple[float, float]:
    """Return the percentile bootstrap 95 % confidence interval of a function of means over
    episodes, from (E, ...). Whole episodes are resampled (Efron 1979), because the decisions within
    one are dependent. `of_means` maps means (..., *episodes.shape[1:]) to the statistic (...);
    resamples where it is NaN do not count.
    """
    # SciPy loads slowly.
    from scipy import stats

    if len(episodes) < 2 or np.ptp(episodes, axis=0).max() == 0.0:
        value = float(of_means(episodes.mean(0)))
        return value, value

    def statistic(index: IntArray, axis: int) -> Any:
        return of_means(episodes[index].mean(axis=axis if axis >= 0 else index.ndim + axis))

    with warnings.catch_warnings():
        # Some resamples do not count.
        warnings.simplefilter("ignore", stats.DegenerateDataWarning)
        distribution = stats.bootstrap(
            (np.arange(len(episodes)),),
            statistic,
            n_resamples=2000,
            batch=100,
            method="percentile",
            rng=0,
        ).bootstrap_distribution
    if np.isnan(distribution).all():
        return float("nan"), float("nan")
    half = 0.5 * 0.95
    low, high = np.nanquantile(distribution, (0.5 - half, 0.5 + half))
    return float(low), float(high)


def wilson_interval(share: float, episodes: int) -> tuple[float, float]:
    """Return Wilson's (1927) interval for the probability of an episode whose share is 1, if all
    have the share 0 or 1; the mean share is at least this probability.
    """
    from scipy import stats

    counted = stats.binomtest(round(share * episodes), episodes)
    interval = counted.proportion_ci(0.95, method="wilson")
    return float(interval.low), float(interval.high)
