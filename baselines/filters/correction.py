"""The correction of Kalman filters by measured positions, one component of a measurement after the other.

Along the principal axes of its covariance R the components of a measurement have independent errors, so that
they can be processed one by one as scalars, without an inverse. Bar-Shalom, Li & Kirubarajan 2001, section
7.4 (sequential processing of measurements).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


class PrincipalNoise(NamedTuple):
    """Covariances of measurements along their principal axes.

    Attributes:
        variances: (d,) or (B, d) [m^2].
        axes: (d, d) or (B, d, d) unit vectors as columns; None if they are the axes of the positions.
    """

    variances: FloatArray
    axes: FloatArray | None

    def of(self, tracks: NDArray[np.bool_]) -> "PrincipalNoise":
        """The covariances of some tracks; (B,) True for these."""
        variances, axes = self
        variances = variances[tracks] if variances.ndim == 2 else variances
        return PrincipalNoise(variances, axes if axes is None or axes.ndim == 2 else axes[tracks])


class Corrected(NamedTuple):
    """Estimates after a measurement.

    Attributes:
        state: (B, n).
        covariance: (B, n, n).
        white: (B, d) innovations, whitened: independent with variance 1 if the model holds.
        log_scale: (B,) half the logarithm of the determinant of the covariance S of the innovation.
    """

    state: FloatArray
    covariance: FloatArray
    white: FloatArray
    log_scale: FloatArray


def principal_noise(covariance: FloatArray) -> PrincipalNoise:
    """Return the principal axes of covariances of measurements, (d, d) or (B, d, d)."""
    diagonal = np.diagonal(covariance, axis1=-2, axis2=-1)
    if np.count_nonzero(covariance) == np.count_nonzero(diagonal):
        return PrincipalNoise(diagonal.copy(), None)
    variances, axes = np.linalg.eigh(covariance)
    return PrincipalNoise(variances, axes)


def correct(
    state: FloatArray, covariance: FloatArray, measurement: FloatArray, noise: PrincipalNoise
) -> Corrected:
    """Correct estimates by measured positions.

    Args:
        state, covariance: predicted, (B, n) and (B, n, n).
        measurement: (B, d) [m].
        noise: of the measurement.
    """
    state, covariance = state.copy(), covariance.copy()
    tracks, d = measurement.shape
    m = state.shape[1] // d
    variances = np.broadcast_to(noise.variances, (tracks, d))
    white, log_scale = np.empty((tracks, d)), np.zeros(tracks)
    for i in range(d):
        if noise.axes is None:
            cross = covariance[:, :, m * i].copy()
            innovation = measurement[:, i] - state[:, m * i]
            predicted = cross[:, m * i]
        else:
            axis = np.broadcast_to(noise.axes[..., i], (tracks, d))
            cross = (covariance[:, :, ::m] @ axis[..., None])[..., 0]  # P h
            innovation = ((measurement - state[:, ::m]) * axis).sum(-1)
            predicted = (cross[:, ::m] * axis).sum(-1)
        total = predicted + variances[:, i]
        gain = cross / total[:, None]
        state += gain * innovation[:, None]
        covariance -= gain[:, :, None] * cross[:, None, :]
        if noise.axes is None:
            # exact where a measurement is far more accurate than the prediction
            after = gain * variances[:, i, None]
            covariance[:, :, m * i] = after
            covariance[:, m * i, :] = after
        white[:, i] = innovation / np.sqrt(total)
        log_scale += 0.5 * np.log(total)
    return Corrected(state, covariance, white, log_scale)


def turned_positions(
    state: FloatArray, covariance: FloatArray, measurement: FloatArray, noise: PrincipalNoise
) -> tuple[FloatArray, FloatArray]:
    """Innovations, (B, d), and covariances H P H', (B, d, d), along the principal axes of the measurements.

    Args:
        state, covariance: predicted, (B, n) and (B, n, n).
        measurement: (B, d) [m].
        noise: of the measurement.
    """
    m = state.shape[1] // measurement.shape[1]
    innovation, predicted = measurement - state[:, ::m], covariance[:, ::m, ::m]
    if noise.axes is None:
        return innovation, predicted
    turned = np.swapaxes(noise.axes, -1, -2)
    return (turned @ innovation[..., None])[..., 0], turned @ predicted @ noise.axes
