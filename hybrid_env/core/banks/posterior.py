"""Mean and covariance of the posterior over the hypotheses of a bank with announced switches, whose
priors are equal.
"""

import math
from typing import Any

from hybrid_env.core.banks import operations
from hybrid_env.core.banks.bank import estimate_of, likeliest
from hybrid_env.core.banks.mixture import NOTHING
from hybrid_env.core.compilation import internal
from hybrid_env.core.memory import FloatArray, Records, State, write_lane
from hybrid_env.core.vectors import combination, minus_square


@internal
def merged_estimate(hypotheses: Records, lane: int) -> State:
    """Return the posterior mean [x, vx, y, vy] of a lane [m, m/s]."""
    largest = hypotheses[likeliest(hypotheses, lane)].log_likelihood[lane]
    total = 0.0
    sums = 0.0, 0.0, 0.0, 0.0
    for h in range(hypotheses.size):
        weight = math.exp(hypotheses[h].log_likelihood[lane] - largest)
        total += weight
        sums = combination((1.0, weight), (sums, estimate_of(hypotheses, h, lane)))
    return sums[0] / total, sums[1] / total, sums[2] / total, sums[3] / total


@internal
def write_merged_covariance(bank: Any, lane: int, mean: State, covariance: FloatArray) -> None:
    """Write the posterior covariance of a lane into (10, LANES); mean: from `merged_estimate`."""
    hypotheses = bank.hypotheses
    largest = hypotheses[likeliest(hypotheses, lane)].log_likelihood[lane]
    total = 0.0
    sums = NOTHING
    for h in range(hypotheses.size):
        weight = math.exp(hypotheses[h].log_likelihood[lane] - largest)
        total += weight
        deviation = combination((1.0, -1.0), (estimate_of(hypotheses, h, lane), mean))
        square = minus_square(operations.covariance(bank, h, lane), deviation, -1.0)
        sums = combination((1.0, weight), (sums, square))
    write_lane(covariance, lane, sums)
    for k in range(covariance.shape[0]):
        covariance[k, lane] /= total
