"""Arrays of measured positions as input of the published bank: checks, the bank, and the first
estimate.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from hybrid_env.checks import FloatArray, IntArray, check_array, check_integer, dimensions, reject
from hybrid_env.core.banks.bank import FilterModel, bank_arrays, estimate_of
from hybrid_env.core.banks.published import PublishedBank, covariance_published
from hybrid_env.core.compilation import internal
from hybrid_env.limits import axis_variances, check_within


class Filters(NamedTuple):
    """A bank and its model, as arguments of compiled functions. A recording uses the first lane."""

    # Of one block.
    bank: PublishedBank
    # (n,) [m]
    radii: FloatArray
    model: FilterModel


def make_filters(
    radii: FloatArray,
    tau: float,
    process_variance: float,
    measurement_variance: float | ArrayLike,
) -> Filters:
    """Return the published bank and its model. Radii (n,) [m] and tick [s] are checked already."""
    process_variance = check_within("process_variance", process_variance)
    variances = axis_variances(measurement_variance)
    model = FilterModel(tau, process_variance, float(variances[0]), float(variances[-1]))
    return Filters(bank_arrays(PublishedBank, radii.size, variances.size), radii, model)


@internal
def write_estimate(
    bank: PublishedBank,
    mode: int,
    estimate: FloatArray,
    covariance: FloatArray,
) -> None:
    """Write the estimate, (4,), and the covariance, (2, 3), of one hypothesis of the first lane."""
    for k, value in enumerate(estimate_of(bank.hypotheses, mode, 0)):
        estimate[k] = value
    triangle = covariance_published(bank, mode, 0)
    covariance[0, 0], covariance[0, 1], covariance[0, 2] = triangle[0], triangle[1], triangle[4]
    covariance[1, 0], covariance[1, 1], covariance[1, 2] = triangle[7], triangle[8], triangle[9]


def first_estimate(measurements: ArrayLike, tau: float, ticks: int = 10) -> FloatArray:
    """Fit a straight line to the first measurements by least squares.

    Args:
        measurements: (T, 2) measured positions [m], or (n, T, 2) for n runs.
        tau: length of a tick [s].
        ticks: number of measurements used for the fit.

    Returns:
        (4,) or (n, 4) estimates [x, vx, y, vy] one tick before the first measurement [m, m/s].
    """
    values = np.asarray(measurements, dtype=np.float64)
    count = min(ticks, values.shape[-2])
    times = tau * np.arange(1, count + 1)
    if count < 2:
        line = np.stack([values[..., 0, :], np.zeros_like(values[..., 0, :])])
    else:
        line = np.linalg.pinv(np.stack([np.ones(count), times], axis=1)) @ values[..., :count, :]
        line = np.moveaxis(line, -2, 0)
    return np.stack(
        [line[0][..., 0], line[1][..., 0], line[0][..., 1], line[1][..., 1]],
        axis=-1,
    )


def check_recording(
    measurements: ArrayLike,
    lengths: Sequence[int] | IntArray,
    start: ArrayLike | None,
    tau: float,
) -> tuple[FloatArray, IntArray, FloatArray]:
    """Return checked measurements (n, T, 2), lengths (K,) and initial estimates (n, 4)."""
    single = dimensions(measurements) == 2
    values = check_array("measurements", measurements, (None, 2) if single else (None, None, 2))
    values = values[None] if single else values
    runs, total = values.shape[:2]
    if not isinstance(lengths, (Sequence, np.ndarray)) or dimensions(lengths) != 1:
        raise reject("lengths", lengths, "a list of integers >= 1")
    ticks = [check_integer("lengths", length) for length in lengths]
    # Of Python's integers, which cannot overflow.
    if sum(ticks) != total:
        raise reject("lengths", ticks, f"lengths whose sum is {total}, the number of measurements")
    segment_lengths = np.array(ticks, np.int64)
    if start is None:
        return values, segment_lengths, first_estimate(values, tau)
    starts = check_array("start", start, (4,) if dimensions(start) == 1 else (runs, 4))
    return values, segment_lengths, np.broadcast_to(starts, (runs, 4))
