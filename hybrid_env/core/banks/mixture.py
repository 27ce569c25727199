"""The mixture of the estimates of an IMM bank: probabilities, and the first two moments. Blom &
Bar-Shalom 1988, output step.
"""

from collections.abc import Callable
from typing import Any

from hybrid_env.core.banks.bank import estimate_of
from hybrid_env.core.compilation import internal
from hybrid_env.core.elementary import exp, log
from hybrid_env.core.memory import Triangle4, state_of, triangle_of, write_lane
from hybrid_env.core.vectors import combination, minus_square

# Smaller log probabilities count as this one.
NEGLIGIBLE = -700.0

NOTHING: Triangle4 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


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
def merge(
    bank: Any, block: Any, first: int, last: int, covariance: Callable[[Any, int], Triangle4]
) -> None:
    """Write the mean and the covariance of the mixture of all filters to the block. covariance: of
    [x, vx, y, vy] of a filter in a lane.
    """
    # Sums of differences lose no digits far from the origin.
    for lane in range(first, last):
        write_lane(block.estimate, lane, estimate_of(bank.hypotheses, 0, lane))
        write_lane(block.covariance, lane, NOTHING)
    for h in range(1, bank.hypotheses.size):
        kalman = bank.hypotheses[h]
        for lane in range(first, last):
            weight = exp(max(kalman.log_probability[lane], NEGLIGIBLE))
            vectors = estimate_of(bank.hypotheses, h, lane), estimate_of(bank.hypotheses, 0, lane)
            difference = combination((1.0, -1.0), vectors)
            mean = combination((1.0, weight), (state_of(block.estimate, lane), difference))
            write_lane(block.estimate, lane, mean)
    for h in range(bank.hypotheses.size):
        kalman = bank.hypotheses[h]
        for lane in range(first, last):
            weight = exp(max(kalman.log_probability[lane], NEGLIGIBLE))
            vectors = estimate_of(bank.hypotheses, h, lane), state_of(block.estimate, lane)
            difference = combination((1.0, -1.0), vectors)
            square = minus_square(covariance(kalman, lane), difference, -1.0)
            sums = combination((1.0, weight), (triangle_of(block.covariance, lane), square))
            write_lane(block.covariance, lane, sums)
