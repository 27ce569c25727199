"""The moving average of measurements, as a step before a filter. Novospaskyi 2025, section 2.3.4."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from baselines.estimation.track_filter import check_measurements
from hybrid_env.checks import check_integer, check_number, dimensions, reject

FloatArray = NDArray[np.float64]


def moving_average(measurements: ArrayLike, window: int, ratio: float = 1.0) -> FloatArray:
    """Average each measurement with those of the ticks before it.

    The weight of a measurement i ticks old is ratio^i, for i = 0 .. window - 1; missing ones have none. With
    ratio 1 the average is (window - 1) / 2 ticks late. A missing measurement remains missing. The errors of
    the averages are smaller than those of the measurements but correlated in time, which no filter here
    assumes.

    Args:
        measurements: (T, B, d) or (T, d) [m], NaN where there is none.
        window: number of ticks, >= 1.
        ratio: of the weight of a measurement to that of the next one, above 0, at most 1.

    Raises:
        ArgumentError: an argument has a value that is not allowed.

    >>> moving_average([[0.0], [1.0], [2.0], [3.0]], window=2).T
    array([[0. , 0.5, 1.5, 2.5]])
    """
    shape = (None, None) if dimensions(measurements) == 2 else (None, None, None)
    values = check_measurements("measurements", measurements, shape)
    window = check_integer("window", window)
    ratio = check_number("ratio", ratio)
    if not 0.0 < ratio <= 1.0:
        raise reject("ratio", ratio, "a number above 0, at most 1")
    present = ~np.isnan(values)
    sums, weights = np.zeros_like(values), np.zeros_like(values)
    known = np.where(present, values, 0.0)
    for age in range(min(window, len(values))):
        weight = ratio**age
        sums[age:] += weight * known[: len(values) - age]
        weights[age:] += weight * present[: len(values) - age]
    return np.where(present, sums / np.where(present, weights, 1.0), np.nan)
