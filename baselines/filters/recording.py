"""Recorded measurements as filters take them, and what a filter writes at each tick."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_env.checks import check_array, check_integer, check_positive, noise_axes, reject
from hybrid_env.core.compilation import internal
from hybrid_env.core.published_bank import (
    FilterModel,
    PublishedBank,
    covariance_published,
    estimate_of,
    published_arrays,
)

FloatArray = NDArray[np.float64]


class Filters(NamedTuple):
    """A bank and what it assumes, as compiled code over recordings takes them; all on the first lane.

    Attributes:
        bank: of one block.
        radii: (n,) turn radii [m].
        model: tick and noise variances.
    """

    bank: PublishedBank
    radii: FloatArray
    model: FilterModel


def make_filters(
    radii: FloatArray, tau: float, process_variance: float, measurement_variance: float | ArrayLike
) -> Filters:
    """The published bank for recordings.

    Args:
        radii: (n,) checked turn radii [m].
        tau: checked tick [s].
        process_variance: Q [m^2/s^2].
        measurement_variance: R [m^2], one number or (x, y).
    """
    process_variance = check_positive("process_variance", process_variance, allow_zero=True)
    variances = noise_axes(measurement_variance)
    model = FilterModel(tau, process_variance, float(variances[0]), float(variances[-1]))
    return Filters(published_arrays(radii.size, variances.size), radii, model)


@internal
def write_estimate(bank: PublishedBank, mode: int, estimate: FloatArray, covariance: FloatArray) -> None:
    """Write estimate (4,) and covariance (2, 3) of one hypothesis of the first lane."""
    for k, value in enumerate(estimate_of(bank.hypotheses, mode, 0)):
        estimate[k] = value
    found = covariance_published(bank, mode, 0)
    covariance[0, 0], covariance[0, 1], covariance[0, 2] = found[0], found[1], found[4]
    covariance[1, 0], covariance[1, 1], covariance[1, 2] = found[7], found[8], found[9]


def first_estimate(measurements: ArrayLike, tau: float, ticks: int = 10) -> FloatArray:
    """Starting estimate of a recording: a straight line through its first ticks, one tick before the first.

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
