"""Mixtures of normal distributions and their weights: the parts that the IMM and the beam of turns share."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def mixture(state: FloatArray, covariance: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return mean and covariance of C mixtures of the same K normal distributions, (B, C, n), (B, C, n, n).

    Args:
        state, covariance: of the distributions, (B, K, n) and (B, K, n, n).
        weights: (B, C, K), sum over K 1.
    """
    mean = weights @ state
    # sum of w (P + x x') less m m', with states relative to one of them, because positions are large
    relative = state - state[:, :1]
    centre = mean - state[:, :1]
    square = covariance + relative[..., :, None] * relative[..., None, :]
    tracks, count, size = state.shape
    mixed = (weights @ square.reshape(tracks, count, size * size)).reshape(*mean.shape, size)
    return mean, mixed - centre[..., :, None] * centre[..., None, :]


def log_sum(logarithms: FloatArray, axis: int) -> FloatArray:
    """Return the logarithms of sums of numbers along an axis, without overflow; of nothing but zeros -inf."""
    largest = logarithms.max(axis, keepdims=True)
    finite = np.where(np.isinf(largest), 0.0, largest)
    with np.errstate(divide="ignore"):
        total = np.log(np.exp(logarithms - finite).sum(axis, keepdims=True)) + finite
    return np.asarray(total.squeeze(axis))
