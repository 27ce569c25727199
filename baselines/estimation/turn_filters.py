"""Kalman filters of coordinated turns with known turn rates, K for each of B flights, with real time steps.

The states are [x, y, vx, vy] (Bar-Shalom, Li & Kirubarajan 2001, section 11.7), driven by white acceleration.
The covariance of a measurement is across^2 I + timing^2 v v' with the predicted velocity v, and its
distribution a Student t: a far measurement is weighted less, by (nu + 2) / (nu + NIS).
"""

import numpy as np
from numpy.typing import NDArray

from baselines.recordings.flights.batch import Batch, measurement_covariances

FloatArray = NDArray[np.float64]

START_SPEED = 100.0  # standard deviation of each component of the velocity at the start [m/s]


def start_filters(batch: Batch, count: int) -> tuple[FloatArray, FloatArray]:
    """Return states (B, K, 4) and covariances (B, K, 4, 4) at the first positions."""
    tracks = batch.times.shape[1]
    velocity = batch.positions[1] - batch.positions[0]
    velocity = velocity / (batch.times[1] - batch.times[0])[:, None]
    state = np.repeat(np.concatenate([batch.positions[0], velocity], axis=1)[:, None], count, axis=1)
    covariance = np.zeros((tracks, count, 4, 4))
    noise = measurement_covariances(velocity, batch.across, batch.timing)
    covariance[:, :, :2, :2] = noise[:, None]
    covariance[:, :, 2, 2] = covariance[:, :, 3, 3] = START_SPEED**2
    return state, covariance


def mixtures(state: FloatArray, covariance: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return mean and covariance of C mixtures of the filters; weights (B, C, K), sum over K 1."""
    mean = weights @ state
    # sum of w (P + x x') less m m', with states relative to one of them, because positions are large
    relative = state - state[:, :1]
    centre = mean - state[:, :1]
    square = covariance + relative[..., :, None] * relative[..., None, :]
    tracks, count = state.shape[:2]
    mixed = (weights @ square.reshape(tracks, count, 16)).reshape(*mean.shape, 4)
    return mean, mixed - centre[..., :, None] * centre[..., None, :]


def predict_turns(
    state: FloatArray, covariance: FloatArray, omega: FloatArray, density: float, steps: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Predict coordinated turns.

    Args:
        state: (B, K, 4).
        covariance: (B, K, 4, 4).
        omega: (B, K) or (K,) turn rates [rad/s], anticlockwise positive.
        density: spectral density of the white acceleration [m^2/s^3].
        steps: (B,) [s].
    """
    angle = omega * steps[:, None]
    safe = np.where(omega == 0.0, 1.0, omega)
    sine, cosine = np.sin(angle), np.cos(angle)
    along = np.where(omega == 0.0, steps[:, None], sine / safe)
    aside = np.where(omega == 0.0, 0.0, (1.0 - cosine) / safe)
    matrix = np.zeros((*angle.shape, 4, 4))
    matrix[..., 0, 0] = matrix[..., 1, 1] = 1.0
    matrix[..., 0, 2] = matrix[..., 1, 3] = along
    matrix[..., 1, 2], matrix[..., 0, 3] = aside, -aside
    matrix[..., 2, 2] = matrix[..., 3, 3] = cosine
    matrix[..., 3, 2], matrix[..., 2, 3] = sine, -sine
    covariance = matrix @ covariance @ matrix.swapaxes(-1, -2)
    dt = steps[:, None]
    for axis in (0, 1):
        covariance[..., axis, axis] += density * dt**3 / 3.0
        covariance[..., axis, axis + 2] += density * dt**2 / 2.0
        covariance[..., axis + 2, axis] += density * dt**2 / 2.0
        covariance[..., axis + 2, axis + 2] += density * dt
    return (matrix @ state[..., None])[..., 0], 0.5 * (covariance + covariance.swapaxes(-1, -2))


def _inverse(matrix: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return inverses and determinants of matrices (..., 2, 2)."""
    a, b, c, d = matrix[..., 0, 0], matrix[..., 0, 1], matrix[..., 1, 0], matrix[..., 1, 1]
    determinant = a * d - b * c
    adjugate = np.stack([np.stack([d, -b], -1), np.stack([-c, a], -1)], -2)
    return adjugate / determinant[..., None, None], determinant


def correct(
    state: FloatArray, covariance: FloatArray, z: FloatArray, noise: FloatArray, freedom: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return corrected states and covariances, and the log-likelihoods (B, K).

    Args:
        state: (B, K, 4).
        covariance: (B, K, 4, 4).
        z: (B, 2) measurements [m].
        noise: (B, 2, 2) their covariances [m^2].
        freedom: degrees of freedom nu.
    """
    innovation = z[:, None] - state[..., :2]
    inverse, determinant = _inverse(covariance[..., :2, :2] + noise[:, None])
    nis = (innovation[..., None, :] @ inverse @ innovation[..., :, None])[..., 0, 0]
    likelihood = -0.5 * np.log(determinant) - 0.5 * (freedom + 2.0) * np.log1p(nis / freedom)
    weight = np.minimum((freedom + 2.0) / (freedom + nis), 1.0)
    inverse, _ = _inverse(covariance[..., :2, :2] + noise[:, None] / weight[..., None, None])
    gain = covariance[..., :, :2] @ inverse
    state = state + (gain @ innovation[..., None])[..., 0]
    return state, covariance - gain @ covariance[..., :2, :], likelihood
