"""The Kalman filter with known modes. Golubkov 2018, table 2 ("optimal").

It runs one filter of the bank per segment, which starts from the last estimate and its covariance. With
P := I at every switch the published table is not reproduced.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from baselines.recordings.arrays import Filters, check_recording, make_filters, write_estimate
from hybrid_env.checks import check_array, check_flag, reject
from hybrid_env.core.banks.published import begin_published, follow_published
from hybrid_env.core.compilation import compiled, prepare
from hybrid_env.core.records import LANES
from hybrid_env.limits import check_within

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Estimates:
    """Output of a filter for n runs of T ticks. A single run has no first axis.

    Attributes:
        estimates: (n, T, 4) estimates [x, vx, y, vy] [m, m/s].
        covariances: (n, T, 2, 3) P_XX, P_XV, P_VV of (position, velocity) on each axis.
    """

    estimates: FloatArray
    covariances: FloatArray


class _Segments(NamedTuple):
    """Lengths [ticks] and signed radii [m] of the segments, (K,) each."""

    lengths: NDArray[np.int64]
    signed_radii: FloatArray


class _Start(NamedTuple):
    """Initial estimate (4,) and covariance (3,), and whether the covariance is carried over at switches."""

    estimate: FloatArray
    covariance: FloatArray
    carry: bool


@compiled
def _filter_run(
    measurements: FloatArray,
    segments: _Segments,
    start: _Start,
    filters: Filters,
    estimates: FloatArray,
    covariances: FloatArray,
) -> None:
    """Filter one run."""
    bank, _, model = filters
    estimate, covariance = start.estimate.copy(), np.empty((2, 3))
    covariance[:] = start.covariance
    measurement = np.zeros((2, LANES))
    k = 0
    for length, signed_radius in zip(segments.lengths, segments.signed_radii):  # noqa: B905, numba does not support `strict`
        radius = np.array([abs(signed_radius) if signed_radius != 0.0 else 1.0])
        mode = 0 if signed_radius == 0.0 else (1 if signed_radius > 0.0 else 2)
        x, vx, y, vy = estimate
        if not start.carry:
            covariance[:] = start.covariance
        first, second = covariance
        anchor_covariance = (
            first[0], first[1], 0.0, 0.0, first[2], 0.0, 0.0, second[0], second[1], second[2],
        )  # fmt: skip
        begin_published(bank, 0, (x, vx, y, vy), anchor_covariance, radius, model)
        for _ in range(length):
            measurement[:, 0] = measurements[k]
            follow_published(bank, 0, mode, measurement, model)
            write_estimate(bank, mode, estimates[k], covariances[k])
            k += 1
        write_estimate(bank, mode, estimate, covariance)


def filter_known_modes(
    measurements: ArrayLike,
    lengths: Sequence[int] | NDArray[np.int64],
    signed_radii: ArrayLike,
    start: ArrayLike | None = None,
    *,
    tau: float = 0.1,
    process_variance: float = 0.001,
    measurement_variance: float | ArrayLike = 0.1,
    start_covariance: ArrayLike = (1.0, 0.0, 1.0),
    carry_covariance: bool = True,
) -> Estimates:
    """Estimate the trajectory of recorded positions with known modes and switch times.

    Args:
        measurements: (T, 2) measured positions [m], or (n, T, 2) for n runs.
        lengths: (K,) segment lengths [ticks], with sum T.
        signed_radii: (K,) turn radii [m], positive to the left, negative to the right, 0 if straight.
        start: (4,) or (n, 4) estimate [x, vx, y, vy] one tick before the first measurement [m, m/s]; None
            uses `first_estimate`.
        tau: length of a tick [s].
        process_variance: Q [m^2/s^2].
        measurement_variance: R [m^2], one number or (x, y).
        start_covariance: (3,) initial xx, xv, vv of (position, velocity) on each axis.
        carry_covariance: False resets the covariance to `start_covariance` at every switch.

    Returns:
        Estimates and covariances; without the first axis for a single run.

    Raises:
        ArgumentError: an argument has a value that is not allowed.
    """
    tau = check_within("tau", tau)
    values, segment_lengths, starts = check_recording(measurements, lengths, start, tau)
    radii = check_array("signed_radii", signed_radii, (None,))
    if radii.size != segment_lengths.size:
        raise reject(
            "signed_radii", signed_radii, f"one radius for each of the {segment_lengths.size} segments"
        )
    filters = make_filters(np.ones(1), tau, process_variance, measurement_variance)
    first = check_array("start_covariance", start_covariance, (3,))
    carry = check_flag("carry_covariance", carry_covariance)
    runs, total = values.shape[:2]
    estimates, covariances = np.empty((runs, total, 4)), np.empty((runs, total, 2, 3))
    for run in range(runs):
        begin = _Start(starts[run], first, carry)
        segments = _Segments(segment_lengths, radii)
        arguments = values[run], segments, begin, filters, estimates[run], covariances[run]
        if run == 0:
            prepare(_filter_run, *arguments)
        _filter_run(*arguments)
    if np.ndim(measurements) == 2:
        return Estimates(estimates[0], covariances[0])
    return Estimates(estimates, covariances)
