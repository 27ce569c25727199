"""Matrices of kinematic models, and random draws."""

import numpy as np
from filterpy.common import Q_continuous_white_noise, Q_discrete_white_noise
from scipy.linalg import block_diag, expm


def matrices(model, dt):
    """F and Q of the whole state, from filterpy's Q and the exponential of the generator."""
    m = model.order
    transition = expm(np.eye(m, k=1) * dt)
    white_noise = (
        Q_continuous_white_noise if model.discretization == "continuous" else Q_discrete_white_noise
    )
    noise = [intensity * white_noise(m, dt) for intensity in model.noise]
    return block_diag(*[transition] * model.axes), block_diag(*noise)


def positions_of(model):
    """H, (d, n)."""
    return np.kron(np.eye(model.axes), np.eye(1, model.order))


def draw(rng, mean, covariance, size):
    """Normal vectors, (size, n), also for singular covariances."""
    values, vectors = np.linalg.eigh(covariance)
    root = vectors * np.sqrt(values.clip(0.0))
    return mean + rng.normal(size=(size, len(values))) @ root.T


def random_covariance(rng, size, scale=1.0):
    root = rng.normal(size=(size, size))
    return scale * (root @ root.T / size + 0.1 * np.eye(size))


def mean_bounds(mean, variance, count, deviations=4.0):
    """Bounds of the mean of independent values: so many standard errors."""
    error = deviations * np.sqrt(variance / count)
    return mean - error, mean + error
