"""The correction of Kalman filters by measured positions, one component of a measurement after the other, without an
inverse: along the principal axes of its covariance they have independent errors. Bar-Shalom, Li & Kirubarajan 2001,
section 7.4 (sequential processing).
"""

from typing import NamedTuple

import numpy as np

from baselines.estimation.robust import Robust, WholeStudentT, gaussian_factors
from hybrid_env.checks import BoolArray, FloatArray


class PrincipalNoise(NamedTuple):
    """Covariances of measurements along their principal axes."""

    variances: FloatArray  # (d,) or (..., d) [m^2]
    axes: FloatArray | None  # (d, d) or (..., d, d) unit vectors as columns; None if they are the axes of the positions

    def of(self, tracks: BoolArray) -> "PrincipalNoise":
        """Return the covariances of the tracks selected by a mask (B,)."""
        variances, axes = self
        variances = variances[tracks] if variances.ndim == 2 else variances
        return PrincipalNoise(variances, axes if axes is None or axes.ndim == 2 else axes[tracks])


class Corrected(NamedTuple):
    """Estimates after a measurement."""

    state: FloatArray  # (..., n)
    covariance: FloatArray  # (..., n, n)
    log_likelihood: FloatArray  # (...) of the measurement
    nis: FloatArray  # (...) squared innovation in units of its covariance


def principal_noise(covariance: FloatArray) -> PrincipalNoise:
    """Return the principal axes of covariances of measurements, (d, d) or (..., d, d)."""
    diagonal = np.diagonal(covariance, axis1=-2, axis2=-1)
    if np.count_nonzero(covariance) == np.count_nonzero(diagonal):
        return PrincipalNoise(diagonal.copy(), None)
    variances, axes = np.linalg.eigh(covariance)
    return PrincipalNoise(variances, axes)


def correct(
    state: FloatArray, covariance: FloatArray, measurement: FloatArray, noise: PrincipalNoise,
    robust: Robust | WholeStudentT | None = None,
) -> Corrected:  # fmt: skip
    """Correct predicted estimates, (..., n) and (..., n, n), by measured positions (..., d) [m]. `robust` says how
    components far from the prediction are used, or whole measurements; None is the Kalman filter.
    """
    state, covariance = state.copy(), covariance.copy()
    lead, d = state.shape[:-1], measurement.shape[-1]
    m = state.shape[-1] // d
    variances = np.broadcast_to(noise.variances, (*lead, d))
    whole = isinstance(robust, WholeStudentT)
    if isinstance(robust, WholeStudentT):
        difference, spread = measurement - state[..., ::m], covariance[..., ::m, ::m]
        if noise.axes is not None:  # along the principal axes
            difference = (difference[..., None, :] @ noise.axes)[..., 0, :]
            spread = noise.axes.swapaxes(-1, -2) @ spread @ noise.axes
        spread = spread + noise.variances[..., None] * np.eye(d)
        weight, of_whole, nis_of_whole = robust.weigh(difference, spread)
        variances, robust = variances / weight[..., None], None
    log_likelihood, nis = np.zeros(lead), np.zeros(lead)
    for i in range(d):
        variance = variances[..., i]
        if noise.axes is None:
            cross = covariance[..., m * i].copy()
            innovation = measurement[..., i] - state[..., m * i]
            predicted = cross[..., m * i].copy()
        else:
            axis = np.broadcast_to(noise.axes[..., i], (*lead, d))
            cross = (covariance[..., ::m] @ axis[..., None])[..., 0]  # P h
            innovation = ((measurement - state[..., ::m]) * axis).sum(-1)
            predicted = (cross[..., ::m] * axis).sum(-1)
        factors = (gaussian_factors if robust is None else robust.factors)(innovation, predicted, variance)
        state += cross * (factors.state * innovation)[..., None]
        covariance -= (cross * factors.covariance[..., None])[..., :, None] * cross[..., None, :]
        if noise.axes is None:
            # m / (m + r) is close to 1 for very accurate measurements: 1 - m b is then r b
            exact = variance * factors.covariance
            left = exact if robust is None else 1.0 - predicted * factors.covariance
            after = cross * left[..., None]
            covariance[..., m * i] = after
            covariance[..., m * i, :] = after
        log_likelihood += factors.log_likelihood
        nis += innovation**2 / (predicted + variance)
    if whole:
        log_likelihood, nis = of_whole, nis_of_whole
    return Corrected(state, covariance, log_likelihood, nis)
