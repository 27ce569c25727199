"""Errors as the thesis computes them.

The formulas of Novospaskyi 2025, eq. (1.25) and (1.26), sum over the axes, but its tables do not: with
noise of 12.5 m on each axis they would list 21.7 and 29.9 m for the measurements, and they list 12.5 and
9.9 m. All eight unfiltered values come out as means over flights and axes of the error within a flight.
The velocity identifies the mean over axes: with an estimate of zero, the root of the mean of all squares
is 28.9 m/s at 50 m/s, and the thesis lists 24.0 m/s.
"""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def flight_errors(estimates: FloatArray, truth: FloatArray) -> tuple[FloatArray, FloatArray]:
    """RMSE and MAE of each flight.

    Args:
        estimates: (..., K, 3) of K measurements.
        truth: (..., K, 3), NaN where a flight has no more measurements.

    Returns:
        RMSE and MAE of each flight, both (...), as means over the axes, in the unit of the estimates.
    """
    error = estimates - truth
    rmse = np.sqrt(np.nanmean(error**2, axis=-2)).mean(-1)
    return rmse, np.nanmean(np.abs(error), axis=-2).mean(-1)


RESAMPLES = 2000


def paired_ratio(errors: FloatArray, others: FloatArray, seed: int) -> tuple[float, float, float]:
    """Ratio of the mean errors of two filters on the same measurements, with its interval over flights.

    Args:
        errors: (runs, F) of the first filter.
        others: (runs, F) of the second one.
        seed: of the resampling.

    Returns:
        Ratio of the means over everything, and the bounds of its 95 % bootstrap interval over flights.
    """
    first, second = errors.mean(0), others.mean(0)
    flights = len(first)
    draws = np.random.default_rng(seed).multinomial(flights, np.full(flights, 1.0 / flights), RESAMPLES)
    low, high = np.percentile((draws @ first) / (draws @ second), [2.5, 97.5])
    return float(first.mean() / second.mean()), float(low), float(high)
