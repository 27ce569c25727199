"""Mixtures of the estimates of a bank: probabilities, and the first two moments. The weights are
the likelihoods with announced switches, whose priors are equal, and the probabilities of the IMM
bank with unknown ones. Blom & Bar-Shalom 1988, output step.
"""

import math
from typing import Any

from hybrid_env.core.banks import operations
from hybrid_env.core.banks.bank import estimate_of, likeliest
from hybrid_env.core.compilation import inlined, internal
from hybrid_env.core.elementary import exp, log
from hybrid_env.core.memory import FloatArray, Records, State, Triangle4

# Smaller log probabilities count as this one.
NEGLIGIBLE = -700.0


@internal
def normalize(bank: Any, first: int, last: int) -> None:
    """Normalize the probabilities of lanes first .. last - 1."""
    sums = bank.sums[0]
    for lane in range(first, last):
        sums.largest[lane] = bank.hypotheses[0].log_probability[lane]
        sums.total[lane] = 0.0
    for h in range(1, bank.hypotheses.size):
        kalman = bank.hypotheses[h]
        for lane in range(first, last):
            sums.largest[lane] = max(sums.largest[lane], kalman.log_probability[lane])
    for h in range(bank.hypotheses.size):
        kalman = bank.hypotheses[h]
        for lane in range(first, last):
            sums.total[lane] += exp(
                max(kalman.log_probability[lane] - sums.largest[lane], NEGLIGIBLE)
            )
    for h in range(bank.hypotheses.size):
        kalman = bank.hypotheses[h]
        for lane in range(first, last):
            # The first difference is exact where it matters, also for very small likelihoods.
            ratio = kalman.log_probability[lane] - sums.largest[lane]
            kalman.log_probability[lane] = ratio - log(sums.total[lane])


@internal
def merge(bank: Any, block: Any, first: int, last: int) -> None:
    """Write the mean and the covariance of the mixture of all filters to the block."""
    estimate, covariance = block.estimate, block.covariance
    # Sums of differences lose no digits far from the origin.
    origin = bank.hypotheses[0]
    for lane in range(first, last):
        estimate[0, lane], estimate[1, lane] = origin.x[lane], origin.vx[lane]
        estimate[2, lane], estimate[3, lane] = origin.y[lane], origin.vy[lane]
        for k in range(10):
            covariance[k, lane] = 0.0
    for h in range(1, bank.hypotheses.size):
        kalman = bank.hypotheses[h]
        for lane in range(first, last):
            weight = exp(max(kalman.log_probability[lane], NEGLIGIBLE))
            estimate[0, lane] += weight * (kalman.x[lane] - origin.x[lane])
            estimate[1, lane] += weight * (kalman.vx[lane] - origin.vx[lane])
            estimate[2, lane] += weight * (kalman.y[lane] - origin.y[lane])
            estimate[3, lane] += weight * (kalman.vy[lane] - origin.vy[lane])
    for h in range(bank.hypotheses.size):
        kalman = bank.hypotheses[h]
        P = kalman.covariance
        for lane in range(first, last):
            weight = exp(max(kalman.log_probability[lane], NEGLIGIBLE))
            a = kalman.x[lane] - estimate[0, lane]
            b = kalman.vx[lane] - estimate[1, lane]
            c = kalman.y[lane] - estimate[2, lane]
            d = kalman.vy[lane] - estimate[3, lane]
            products = a * a, a * b, a * c, a * d, b * b, b * c, b * d, c * c, c * d, d * d
            for k in range(10):
                covariance[k, lane] += weight * (P[k, lane] + products[k])


@inlined
def mixture_of_two(
    weight: float, mine: Triangle4, merged: Triangle4, difference: State
) -> Triangle4:
    """Return the covariance of a mixture of two normal distributions. weight: of the first."""
    rest = 1.0 - weight
    a, b, c, d = difference
    spread = weight * rest
    return (
        weight * mine[0] + rest * merged[0] + spread * a * a,
        weight * mine[1] + rest * merged[1] + spread * a * b,
        weight * mine[2] + rest * merged[2] + spread * a * c,
        weight * mine[3] + rest * merged[3] + spread * a * d,
        weight * mine[4] + rest * merged[4] + spread * b * b,
        weight * mine[5] + rest * merged[5] + spread * b * c,
        weight * mine[6] + rest * merged[6] + spread * b * d,
        weight * mine[7] + rest * merged[7] + spread * c * c,
        weight * mine[8] + rest * merged[8] + spread * c * d,
        weight * mine[9] + rest * merged[9] + spread * d * d,
    )


@internal
def merged_estimate(hypotheses: Records, lane: int) -> State:
    """Return the posterior mean [x, vx, y, vy] of a lane [m, m/s]."""
    largest = hypotheses[likeliest(hypotheses, lane)].log_likelihood[lane]
    total = 0.0
    x = 0.0
    vx = 0.0
    y = 0.0
    vy = 0.0
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
def write_merged_covariance(bank: Any, lane: int, mean: State, covariance: FloatArray) -> None:
    """Write the posterior covariance of a lane into (10, LANES); mean: from `merged_estimate`."""
    hypotheses = bank.hypotheses
    largest = hypotheses[likeliest(hypotheses, lane)].log_likelihood[lane]
    total = 0.0
    for k in range(covariance.shape[0]):
        covariance[k, lane] = 0.0
    for h in range(hypotheses.size):
        weight = math.exp(hypotheses[h].log_likelihood[lane] - largest)
        total += weight
        estimate = estimate_of(hypotheses, h, lane)
        entries = operations.covariance(bank, h, lane)
        k = 0
        for row in range(4):
            deviation = estimate[row] - mean[row]
            for column in range(row, 4):
                product = deviation * (estimate[column] - mean[column])
                covariance[k, lane] += weight * (entries[k] + product)
                k += 1
    for k in range(covariance.shape[0]):
        covariance[k, lane] /= total
