"""The Kalman filter that knows every mode. Golubkov 2018, table 2 ("optimal").

It runs one hypothesis of the bank per piece, anchored at its own estimate, and carries its covariance over
the switches. The table is not reproduced with P := I at every piece.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from baselines.filters.recording import Filters, check_recording, make_filters, write_estimate
from hybrid_env.checks import check_array, check_flag, check_positive, reject
from hybrid_env.core.compilation import compiled
from hybrid_env.core.published_bank import begin_published, follow_published
from hybrid_env.core.records import LANES

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Estimates:
    """Filter output of n runs of T ticks; a single run has no first axis.

    Attributes:
        estimates: (n, T, 4) [x, vx, y, vy] [m, m/s].
        covariances: (n, T, 2, 3) of (position, velocity) on each axis: P_XX, P_XV, P_VV.
    """

    estimates: FloatArray
    covariances: FloatArray


class _Pieces(NamedTuple):
    """(K,) lengths in ticks and signed radii [m] of the pieces."""

    lengths: NDArray[np.int64]
    signed_radii: FloatArray


class _Start(NamedTuple):
    """Estimate (4,) and covariance (3,) at the start, and whether the covariance is carried over switches."""

    estimate: FloatArray
    covariance: FloatArray
    carry: bool


@compiled
def _filter_run(
    measurements: FloatArray,
    pieces: _Pieces,
    start: _Start,
    filters: Filters,
    estimates: FloatArray,
    covariances: FloatArray,
) -> None:
    bank, _, model = filters
    estimate, covariance = start.estimate.copy(), np.empty((2, 3))
    covariance[:] = start.covariance
    measurement = np.zeros((2, LANES))
    k = 0
    for length, signed_radius in zip(pieces.lengths, pieces.signed_radii):  # noqa: B905, numba has no strict
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
    """Kalman filter over pieces of known modes.

    Args:
        measurements: (T, 2) or (n, T, 2) [m].
        lengths: (K,) ticks of the pieces; they add up to T.
        signed_radii: (K,) [m], positive to the left, negative to the right, 0 straight.
        start: (4,) or (n, 4) estimate one tick before the first measurement; None takes `first_estimate`.
        tau, process_variance, measurement_variance: as in `ate.track`.
        start_covariance: (3,) of (position, velocity) on both axes.
        carry_covariance: False starts every piece with `start_covariance` again.

    Raises:
        ArgumentError: names the argument, its value and what is allowed.
    """
    tau = check_positive("tau", tau)
    values, pieces, starts = check_recording(measurements, lengths, start, tau)
    radii = check_array("signed_radii", signed_radii, (None,))
    if radii.size != pieces.size:
        raise reject("signed_radii", signed_radii, f"one radius for each of the {pieces.size} pieces")
    filters = make_filters(np.ones(1), tau, process_variance, measurement_variance)
    first = check_array("start_covariance", start_covariance, (3,))
    carry = check_flag("carry_covariance", carry_covariance)
    runs, total = values.shape[:2]
    estimates, covariances = np.empty((runs, total, 4)), np.empty((runs, total, 2, 3))
    for run in range(runs):
        begin = _Start(starts[run], first, carry)
        _filter_run(values[run], _Pieces(pieces, radii), begin, filters, estimates[run], covariances[run])
    if np.ndim(measurements) == 2:
        return Estimates(estimates[0], covariances[0])
    return Estimates(estimates, covariances)
