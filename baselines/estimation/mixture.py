"""Mixtures of normal distributions."""

from hybrid_env.checks import FloatArray, Moments


def mixture(state: FloatArray, covariance: FloatArray, weights: FloatArray) -> Moments:
    """Return mean and covariance of C mixtures, (B, C, n) and (B, C, n, n), of the same K normal
    distributions, (B, K, n) and (B, K, n, n), with weights (B, C, K).
    """
    mean = weights @ state
    # Sum of w (P + x x') less m m', with states relative to one of them, because positions are
    # large.
    relative = state - state[:, :1]
    centre = mean - state[:, :1]
    square = covariance + relative[..., :, None] * relative[..., None, :]
    tracks, count, size = state.shape
    mixed = (weights @ square.reshape(tracks, count, size * size)).reshape(*mean.shape, size)
    return mean, mixed - centre[..., :, None] * centre[..., None, :]
