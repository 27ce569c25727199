"""The output step of the IMM bank: normalized probabilities, and mean and covariance of the mixture.

Blom & Bar-Shalom 1988; see `imm_bank`.
"""

from typing import Any

import numpy as np

from hybrid_env.core.compilation import internal
from hybrid_env.core.elementary import exp, log
from hybrid_env.core.records import lanes_of

SUMS = lanes_of(("largest", np.float64, ()), ("total", np.float64, ()))
"""Maximum log probability of the hypotheses before normalization, and the sum relative to it."""

NEGLIGIBLE = -700.0  # smaller log probabilities count as this one


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
            sums.total[lane] += exp(max(kalman.log_probability[lane] - sums.largest[lane], NEGLIGIBLE))
    for h in range(bank.hypotheses.size):
        kalman = bank.hypotheses[h]
        for lane in range(first, last):
            # the first difference is exact where it matters, also for very small likelihoods
            ratio = kalman.log_probability[lane] - sums.largest[lane]
            kalman.log_probability[lane] = ratio - log(sums.total[lane])


@internal
def merge(bank: Any, block: Any, first: int, last: int) -> None:
    """Write the mean and the covariance of the mixture of all filters to the block."""
    estimate, covariance = block.estimate, block.covariance
    origin = bank.hypotheses[0]  # sums of differences lose no digits far from the origin
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
            a, b = kalman.x[lane] - estimate[0, lane], kalman.vx[lane] - estimate[1, lane]
            c, d = kalman.y[lane] - estimate[2, lane], kalman.vy[lane] - estimate[3, lane]
            covariance[0, lane] += weight * (P[0, lane] + a * a)
            covariance[1, lane] += weight * (P[1, lane] + a * b)
            covariance[2, lane] += weight * (P[2, lane] + a * c)
            covariance[3, lane] += weight * (P[3, lane] + a * d)
            covariance[4, lane] += weight * (P[4, lane] + b * b)
            covariance[5, lane] += weight * (P[5, lane] + b * c)
            covariance[6, lane] += weight * (P[6, lane] + b * d)
            covariance[7, lane] += weight * (P[7, lane] + c * c)
            covariance[8, lane] += weight * (P[8, lane] + c * d)
            covariance[9, lane] += weight * (P[9, lane] + d * d)
