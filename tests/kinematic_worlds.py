"""Random tracks of kinematic models, drawn with matrices of the whole state."""

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


def squared_errors(error, covariance):
    """Errors squared in units of their covariances (NEES), (B,)."""
    return np.einsum("bi,bij,bj->b", error, np.linalg.inv(covariance), error)


def draw(rng, mean, covariance, size):
    """Normal vectors, (size, n), also for singular covariances."""
    values, vectors = np.linalg.eigh(covariance)
    root = vectors * np.sqrt(values.clip(0.0))
    return mean + rng.normal(size=(size, len(values))) @ root.T


def simulate(rng, model, times, start_covariance, noise, tracks):
    """States (T, B, n) and measurements (T, B, d) of tracks that begin at time 0 with this
    covariance.
    """
    state = draw(rng, 0.0, start_covariance, tracks)
    states = []
    last = 0.0
    for time in times:
        transition, spread = matrices(model, time - last)
        state = state @ transition.T + draw(rng, 0.0, spread, tracks)
        states.append(state)
        last = time
    states = np.array(states)
    errors = draw(rng, 0.0, noise, len(times) * tracks).reshape(len(times), tracks, -1)
    return states, states @ positions_of(model).T + errors


def random_covariance(rng, size, scale=1.0):
    root = rng.normal(size=(size, size))
    return scale * (root @ root.T / size + 0.1 * np.eye(size))


def mean_bounds(mean, variance, count, deviations=4.0):
    """Bounds of the mean of independent values: so many standard errors."""
    error = deviations * np.sqrt(variance / count)
    return mean - error, mean + error
