"""Errors as the thesis computes them.

The formulas of Novospaskyi 2025, eq. (1.25) and (1.26), sum over the axes, but its tables do not: with noise of
12.5 m on each axis they would list 21.7 and 29.9 m for the measurements, and they list 12.5 and 9.9 m. The unfiltered
values of all eight columns come out as means over flights and axes of the error within a flight. The velocity
identifies the mean over axes: with an estimate of zero, the root of the mean of all squares is 28.9 m/s at 50 m/s,
and the thesis lists 24.0 m/s.
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
