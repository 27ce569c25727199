"""Recorded measurements as filters take them, and what a filter writes at each tick."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_env.checks import check_array, check_integer, reject
from hybrid_env.core import published_bank as bank
from hybrid_env.core.compilation import internal

FloatArray = NDArray[np.float64]


@internal
def note(filters: bank.Bank, mode: int, estimate: FloatArray, covariance: FloatArray) -> None:
    """Write what one hypothesis of the first lane holds: estimate (4,) and covariance (2, 3)."""
    for k, value in enumerate(bank.estimate_of(filters.hypotheses, mode, 0)):
        estimate[k] = value
    for axis, values in enumerate(bank.covariance_of(filters.covariances, mode, 0)):
        for k, value in enumerate(values):
            covariance[axis, k] = value


def first_estimate(measurements: ArrayLike, tau: float, ticks: int = 10) -> FloatArray:
    """Where a recording starts: a straight line through its first ticks, one tick before the first.

    Args:
        measurements: (T, 2) or (n, T, 2) [m].
        tau: tick [s].
        ticks: how many measurements the least-squares line takes.

    Returns:
        (4,) or (n, 4) estimates [x, vx, y, vy] [m, m/s].
    """
    values = np.asarray(measurements, dtype=np.float64)
    count = min(ticks, values.shape[-2])
    times = tau * np.arange(1, count + 1)
    if count < 2:
        line = np.stack([values[..., 0, :], np.zeros_like(values[..., 0, :])])
    else:
        line = np.linalg.pinv(np.stack([np.ones(count), times], axis=1)) @ values[..., :count, :]
        line = np.moveaxis(line, -2, 0)
    return np.stack([line[0][..., 0], line[1][..., 0], line[0][..., 1], line[1][..., 1]], axis=-1)


def check_recording(
    measurements: ArrayLike, lengths: Sequence[int] | NDArray[np.int64], start: ArrayLike | None, tau: float
) -> tuple[FloatArray, NDArray[np.int64], FloatArray]:
    """Measurements (n, T, 2), lengths (K,) and starting estimates (n, 4), or a one-line error."""
    single = np.ndim(measurements) == 2
    values = check_array("measurements", measurements, (None, 2) if single else (None, None, 2))
    values = values[None] if single else values
    runs, total = values.shape[:2]
    pieces = np.array([check_integer("lengths", length) for length in lengths], dtype=np.int64)
    if pieces.sum() != total:
        raise reject("lengths", list(lengths), f"lengths that add up to the {total} ticks of measurements")
    if start is None:
        return values, pieces, first_estimate(values, tau)
    starts = check_array("start", start, (4,) if np.ndim(start) == 1 else (runs, 4))
    return values, pieces, np.broadcast_to(starts, (runs, 4))
