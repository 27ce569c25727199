"""The posterior over the hypotheses of a bank, and the mean and the covariance of the mixture of
its filters. Blom & Bar-Shalom 1988, output step. Likelihoods are over the largest one, so that a
hypothesis needs one exponential in a tick.
"""

from collections.abc import Callable
from typing import Any

from hybrid_env.core.arrays import FloatArray, IntArray
from hybrid_env.core.banks.bank import estimate_of
from hybrid_env.core.compilation import internal
from hybrid_env.core.elementary import exp
from hybrid_env.core.memory import Triangle4, state_of, triangle_of, write_lane
from hybrid_env.core.vectors import combination, minus_square

NOTHING: Triangle4 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@internal
def by_likelihood(kalman: Any) -> FloatArray:
    """Return the log-likelihoods of a filter: the log posterior, if the priors are equal."""
    values: FloatArray = kalman.log_likelihood
    return values


@internal
def compare(bank: Any, log_posterior: Callable[[Any], FloatArray], first: int, last: int) -> None:
    """Compute the posterior of lanes first .. last - 1. log_posterior: of a filter, up to a
    constant.
    """
    hypotheses, sums = bank.hypotheses, bank.sums[0]
    for lane in range(first, last):
        sums.largest[lane] = log_posterior(hypotheses[0])[lane]
        sums.likeliest[lane] = 0
        sums.others[lane] = 0.0
    for h in range(1, hypotheses.size):
        values = log_posterior(hypotheses[h])
        for lane in range(first, last):
            better = values[lane] > sums.largest[lane]
            sums.likeliest[lane] = h if better else sums.likeliest[lane]
            sums.largest[lane] = values[lane] if better else sums.largest[lane]
    for h in range(hypotheses.size):
        values = log_posterior(hypotheses[h])
        likelihoods = bank.likelihoods[h]
        for lane in range(first, last):
            # The logarithm of a smaller ratio counts as -100.
            likelihood = exp(max(values[lane] - sums.largest[lane], -100.0))
            likelihoods[lane] = likelihood
            # A sum with that of the likeliest, 1, would lose the digits of small terms.
            sums.others[lane] += 0.0 if sums.likeliest[lane] == h else likelihood
    for lane in range(first, last):
        sums.inverse[lane] = 1.0 / (1.0 + sums.others[lane])


@internal
def compare_types(
    bank: Any, types: IntArray, likelihoods: FloatArray, ratios: FloatArray, first: int, last: int
) -> None:
    """Compute the ratio of all other types to the likeliest type of lanes first .. last - 1,
    (LANES,), after `compare`. types: (M,) of every hypothesis; likelihoods: (types, LANES), both
    overwritten.
    """
    for of_type in range(likelihoods.shape[0]):
        for lane in range(first, last):
            likelihoods[of_type, lane] = 0.0
    for h in range(types.size):
        of_type = types[h]
        for lane in range(first, last):
            likelihoods[of_type, lane] += bank.likelihoods[h, lane]
    for lane in range(first, last):
        likeliest_type = 0
        for of_type in range(1, likelihoods.shape[0]):
            if likelihoods[of_type, lane] > likelihoods[likeliest_type, lane]:
                likeliest_type = of_type
        # The sum of the smaller ones is not a difference, which would lose the digits of small
        # terms.
        others = 0.0
        for of_type in range(likelihoods.shape[0]):
            others += likelihoods[of_type, lane] if of_type != likeliest_type else 0.0
        ratios[lane] = others / likelihoods[likeliest_type, lane]


@internal
def write_mean(bank: Any, block: Any, first: int, last: int) -> None:
    """Write the mean of the mixture to the estimate of the block, after `compare`."""
    # Sums of differences lose no digits far from the origin.
    for lane in range(first, last):
        write_lane(block.estimate, lane, estimate_of(bank.hypotheses, 0, lane))
    for h in range(1, bank.hypotheses.size):
        for lane in range(first, last):
            weight = bank.likelihoods[h, lane] * bank.sums[0].inverse[lane]
            vectors = estimate_of(bank.hypotheses, h, lane), estimate_of(bank.hypotheses, 0, lane)
            difference = combination((1.0, -1.0), vectors)
            mean = combination((1.0, weight), (state_of(block.estimate, lane), difference))
            write_lane(block.estimate, lane, mean)


@internal
def write_covariance(
    bank: Any, block: Any, first: int, last: int, covariance: Callable[..., Triangle4]
) -> None:
    """Write the covariance of the mixture to that of the block, after `write_mean`. covariance: of
    [x, vx, y, vy] of a hypothesis of a bank in a lane.
    """
    for lane in range(first, last):
        write_lane(block.covariance, lane, NOTHING)
    for h in range(bank.hypotheses.size):
        for lane in range(first, last):
            weight = bank.likelihoods[h, lane] * bank.sums[0].inverse[lane]
            vectors = estimate_of(bank.hypotheses, h, lane), state_of(block.estimate, lane)
            difference = combination((1.0, -1.0), vectors)
            square = minus_square(covariance(bank, h, lane), difference, -1.0)
            sums = combination((1.0, weight), (triangle_of(block.covariance, lane), square))
            write_lane(block.covariance, lane, sums)
