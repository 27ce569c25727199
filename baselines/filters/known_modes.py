"""The filter that knows every mode: what tracking could be at best. Golubkov 2018, table 2 ("optimal").

It runs one hypothesis of the bank a piece, anchored at its own estimate, and carries its covariance over the
switches; the table does not come out with P := I at every piece.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from baselines.filters.recording import check_recording, note
from hybrid_env.checks import check_array, check_flag, check_positive, noise_axes, reject
from hybrid_env.core import published_bank as bank
from hybrid_env.core.compilation import compiled

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


@compiled
def _filter_run(
    measurements: FloatArray,
    lengths: NDArray[np.int64],
    signed_radii: FloatArray,
    start: FloatArray,
    start_covariance: FloatArray,
    carry: bool,
    filters: bank.Bank,
    tau: float,
    process_variance: float,
    variances: FloatArray,
    estimates: FloatArray,
    covariances: FloatArray,
) -> None:
    estimate = start.copy()
    covariance = np.empty((2, 3))
    covariance[:] = start_covariance
    rx, ry = variances[0], variances[-1]
    k = 0
    for piece in range(lengths.size):
        radius = np.array([abs(signed_radii[piece]) if signed_radii[piece] != 0.0 else 1.0])
        mode = 0 if signed_radii[piece] == 0.0 else (1 if signed_radii[piece] > 0.0 else 2)
        x, vx, y, vy = estimate
        if not carry:
            covariance[:] = start_covariance
        first, second = covariance
        bank.anchor_bank(
            filters, 0, (x, vx, y, vy), radius, tau,
            (first[0], first[1], first[2]), (second[0], second[1], second[2]),
        )  # fmt: skip
        for _ in range(lengths[piece]):
            x, y = measurements[k]
            bank.step_alone(filters, 0, mode, x, y, process_variance, rx, ry)
            note(filters, mode, estimates[k], covariances[k])
            k += 1
        note(filters, mode, estimate, covariance)


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
    process_variance = check_positive("process_variance", process_variance, allow_zero=True)
    variances = noise_axes(measurement_variance)
    first = check_array("start_covariance", start_covariance, (3,))
    carry = check_flag("carry_covariance", carry_covariance)
    filters = bank.bank_arrays(1, variances.size)
    runs, total = values.shape[:2]
    estimates, covariances = np.empty((runs, total, 4)), np.empty((runs, total, 2, 3))
    for run in range(runs):
        _filter_run(
            values[run], pieces, radii, starts[run], first, carry, filters, tau,
            process_variance, variances, estimates[run], covariances[run],
        )  # fmt: skip
    if np.ndim(measurements) == 2:
        return Estimates(estimates[0], covariances[0])
    return Estimates(estimates, covariances)
