"""The merged estimate of a bank: mean and covariance of the posterior over all hypotheses.

With equal priors the posterior is a mixture of the estimates, weighted by the likelihoods. Its first two
moments are those of Blom & Bar-Shalom 1988, "The interacting multiple model algorithm", output step.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_env.core import bank_operations
from hybrid_env.core.compilation import internal
from hybrid_env.core.published_bank import State, estimate_of, likeliest


@internal
def merged_estimate(hypotheses: NDArray[Any], lane: int) -> State:
    """Return the posterior mean [x, vx, y, vy] of a lane [m, m/s]."""
    largest = hypotheses[likeliest(hypotheses, lane)].log_likelihood[lane]
    total, x, vx, y, vy = 0.0, 0.0, 0.0, 0.0, 0.0
    for h in range(hypotheses.size):
        weight = math.exp(hypotheses[h].log_likelihood[lane] - largest)
        estimate = estimate_of(hypotheses, h, lane)
        total += weight
        x += weight * estimate[0]
        vx += weight * estimate[1]
        y += weight * estimate[2]
        vy += weight * estimate[3]
    return x / total, vx / total, y / total, vy / total


@internal
def write_merged_covariance(bank: Any, lane: int, mean: State, covariance: NDArray[np.float64]) -> None:
    """Write the posterior covariance of a lane.

    Args:
        bank: bank of the block.
        lane: index of the track in the block.
        mean: from `merged_estimate`.
        covariance: (10, LANES), upper triangle row by row; the column of the lane is written.
    """
    hypotheses = bank.hypotheses
    largest = hypotheses[likeliest(hypotheses, lane)].log_likelihood[lane]
    total = 0.0
    for k in range(covariance.shape[0]):
        covariance[k, lane] = 0.0
    deviation = np.empty(4)
    for h in range(hypotheses.size):
        weight = math.exp(hypotheses[h].log_likelihood[lane] - largest)
        total += weight
        for axis, value in enumerate(estimate_of(hypotheses, h, lane)):
            deviation[axis] = value - mean[axis]
        entries = bank_operations.covariance(bank, h, lane)
        k = 0
        for row in range(4):
            for column in range(row, 4):
                covariance[k, lane] += weight * (entries[k] + deviation[row] * deviation[column])
                k += 1
    for k in range(covariance.shape[0]):
        covariance[k, lane] /= total
