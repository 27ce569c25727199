"""The interacting multiple model (IMM) bank: filters that run on over switches at unknown moments.

Blom & Bar-Shalom 1988, "The interacting multiple model algorithm for systems with Markovian switching
coefficients". Each of M hypotheses has a Kalman filter of a coordinated turn (`coordinated_turn`)
and a probability. The mode is a Markov chain with the transition matrix

    1 - hazard          on the diagonal,
    hazard / (M - 1)    elsewhere,

whose rows sum to 1. A tick has three steps:

1. Mixing. The mode before the tick, given the mode h in the tick, is h with the probability w and otherwise
   distributed as without this knowledge. The initial condition of filter h is therefore a mixture of two
   terms: its own estimate, with weight w, and the merged estimate of all filters, with weight 1 - w. It is
   replaced by a normal distribution with the same mean and covariance.
2. Every filter predicts, is corrected by the measurement, and gives its log-likelihood, which updates the log
   probability. Logarithms of probabilities are stored, so that none of them is lost in an outlier.
3. Output. Mean and covariance of the mixture of all filters are the merged estimate.

A filter that diverges keeps its initial condition and becomes unlikely, so that no NaN occurs.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid_env.core.compilation import inlined, internal
from hybrid_env.core.coordinated_turn import (
    condition_x,
    exchange_axes,
    predict_covariance,
    turn_angle,
    turn_coefficients,
)
from hybrid_env.core.elementary import exp, log
from hybrid_env.core.kalman import log_likelihood
from hybrid_env.core.memory import aligned_zeros, array_at
from hybrid_env.core.published_bank import INNOVATION, State, Triangle4, set_estimate, signed_radius
from hybrid_env.core.records import lanes_of

IMM_HYPOTHESIS = lanes_of(
    *((name, np.float64, ()) for name in ("x", "vx", "y", "vy")),  # estimate [m, m/s]
    ("covariance", np.float64, (10,)),  # upper triangle row by row
    ("log_probability", np.float64, ()),
    ("log_likelihood", np.float64, ()),  # of the current tick
)
"""State of one filter."""

SUMS = lanes_of(("largest", np.float64, ()), ("total", np.float64, ()))
"""Maximum log probability of the hypotheses before normalization, and the sum relative to it."""

NEGLIGIBLE = -700.0  # smaller log probabilities count as this one
DIVERGED = -1e3  # log-likelihood of a tick in which a filter diverges
LARGEST = 1e12  # [m] or [m/s]; a filter with larger values has diverged


class ImmBank(NamedTuple):
    """The bank of a block of tracks.

    Attributes:
        hypotheses: (M,) records `IMM_HYPOTHESIS`.
        innovations: (M,) records `published_bank.INNOVATION`, temporary memory shared by the blocks of a
            thread.
        sums: (1,) record `SUMS`, temporary memory shared by the blocks of a thread.
    """

    hypotheses: NDArray[Any]
    innovations: NDArray[Any]
    sums: NDArray[Any]


class ImmModel(NamedTuple):
    """The model assumed by the filters. `quickest_records.QUICKEST_PARAMETERS` has the same fields.

    Attributes:
        tau: length of a tick [s].
        process_variance: Q [m^2/s^2].
        variance_x, variance_y: R of each axis [m^2].
        stay_probability: diagonal entry of the transition matrix, 1 - hazard.
        switch_probability: every other entry, hazard / (M - 1), at most `stay_probability`.
    """

    tau: float
    process_variance: float
    variance_x: float
    variance_y: float
    stay_probability: float
    switch_probability: float


def imm_arrays(radii_count: int, *blocks: int) -> ImmBank:
    """Return a bank of zeros. `blocks` is prepended to the shape of arrays that are not shared by blocks."""
    hypotheses = 2 * radii_count + 1
    return ImmBank(
        aligned_zeros((*blocks, hypotheses), IMM_HYPOTHESIS),
        aligned_zeros((hypotheses,), INNOVATION),
        aligned_zeros((1,), SUMS),
    )


@inlined
def imm_of_block(setting: Any, block: int) -> ImmBank:
    """Return the bank of one block from the addresses in a record `QUICKEST_PARAMETERS`."""
    hypotheses = 2 * setting.radii_count + 1
    return ImmBank(
        array_at(setting.hypotheses, (setting.blocks_count, hypotheses), IMM_HYPOTHESIS)[block],
        array_at(setting.innovations, (hypotheses,), INNOVATION),
        array_at(setting.sums, (1,), SUMS),
    )


@internal
def begin_imm(bank: ImmBank, block: Any, lane: int, known: int) -> None:
    """Start every filter of a lane from the merged estimate of the block.

    Args:
        bank: bank of the block.
        block: a record with the fields `estimate`, (4, LANES), and `covariance`, (10, LANES).
        lane: index of the track in the block.
        known: the mode before the first tick; -1 if it is not known, all equally probable.
    """
    for h in range(bank.hypotheses.size):
        kalman = bank.hypotheses[h]
        set_estimate(kalman, lane, _merged_mean(block, lane))
        for k in range(10):
            kalman.covariance[k, lane] = block.covariance[k, lane]
        if known < 0:
            kalman.log_probability[lane] = -math.log(bank.hypotheses.size)
        else:
            kalman.log_probability[lane] = 0.0 if h == known else NEGLIGIBLE
        kalman.log_likelihood[lane] = 0.0


@inlined
def _merged_mean(block: Any, lane: int) -> State:
    estimate = block.estimate
    return estimate[0, lane], estimate[1, lane], estimate[2, lane], estimate[3, lane]


@inlined
def _triangle(p: NDArray[np.float64], lane: int) -> Triangle4:
    return (
        p[0, lane], p[1, lane], p[2, lane], p[3, lane], p[4, lane],
        p[5, lane], p[6, lane], p[7, lane], p[8, lane], p[9, lane],
    )  # fmt: skip


@inlined
def _mixture(own: float, mine: Triangle4, merged: Triangle4, difference: State) -> Triangle4:
    """Return the covariance of a mixture of two normal distributions.

    Args:
        own: weight of the first.
        mine, merged: covariances of the first and of the second.
        difference: of their means.
    """
    rest = 1.0 - own
    a, b, c, d = difference
    spread = own * rest
    return (
        own * mine[0] + rest * merged[0] + spread * a * a,
        own * mine[1] + rest * merged[1] + spread * a * b,
        own * mine[2] + rest * merged[2] + spread * a * c,
        own * mine[3] + rest * merged[3] + spread * a * d,
        own * mine[4] + rest * merged[4] + spread * b * b,
        own * mine[5] + rest * merged[5] + spread * b * c,
        own * mine[6] + rest * merged[6] + spread * b * d,
        own * mine[7] + rest * merged[7] + spread * c * c,
        own * mine[8] + rest * merged[8] + spread * c * d,
        own * mine[9] + rest * merged[9] + spread * d * d,
    )


@internal
def _step_hypothesis(
    kalman: Any, innovation: Any, block: Any, first: int, last: int, curvature: float, model: Any
) -> None:
    """Mix, predict and correct one filter of lanes first .. last - 1, without normalizing its probability."""
    P = kalman.covariance
    variance_x, variance_y = model.variance_x, model.variance_y
    for lane in range(first, last):
        merged_x, merged_u, merged_y, merged_v = _merged_mean(block, lane)
        probability = exp(max(kalman.log_probability[lane], NEGLIGIBLE))
        from_itself = (model.stay_probability - model.switch_probability) * probability
        prior = from_itself + model.switch_probability
        own = from_itself / prior
        difference = (
            kalman.x[lane] - merged_x, kalman.vx[lane] - merged_u,
            kalman.y[lane] - merged_y, kalman.vy[lane] - merged_v,
        )  # fmt: skip
        x, u = merged_x + own * difference[0], merged_u + own * difference[1]
        y, v = merged_y + own * difference[2], merged_v + own * difference[3]
        mixed = _mixture(own, _triangle(P, lane), _triangle(block.covariance, lane), difference)

        turn = turn_coefficients(turn_angle(u, v, curvature, model.tau), model.tau)
        C, S, along, across = turn
        predicted = predict_covariance(mixed, turn, model.process_variance)
        new_x, new_y = x + along * u - across * v, y + across * u + along * v
        new_u, new_v = C * u - S * v, S * u + C * v
        # sequential corrections by x and y; the product of both densities is the joint density
        sigma_x = predicted[0] + variance_x
        inverse_x = 1.0 / sigma_x
        innovation_x = block.measurement[0, lane] - new_x
        gain_x = innovation_x * inverse_x
        after_x = exchange_axes(condition_x(predicted, inverse_x, variance_x))
        sigma_y = after_x[0] + variance_y
        inverse_y = 1.0 / sigma_y
        innovation_y = block.measurement[1, lane] - (new_y + predicted[2] * gain_x)
        gain_y = innovation_y * inverse_y
        corrected = exchange_axes(condition_x(after_x, inverse_y, variance_y))
        white_x, white_y = innovation_x * math.sqrt(inverse_x), innovation_y * math.sqrt(inverse_y)
        log_variance = 0.5 * (log(sigma_x) + log(sigma_y))

        # these comparisons are False for NaN and for values that would lead to NaN
        valid = (
            (sigma_x + sigma_y < LARGEST * LARGEST)
            & (predicted[4] + predicted[9] < LARGEST * LARGEST)
            & (abs(innovation_x) + abs(innovation_y) + abs(new_u) + abs(new_v) < LARGEST)
        )
        kalman.x[lane] = new_x + predicted[0] * gain_x + after_x[2] * gain_y if valid else x
        kalman.vx[lane] = new_u + predicted[1] * gain_x + after_x[3] * gain_y if valid else u
        kalman.y[lane] = new_y + predicted[2] * gain_x + after_x[0] * gain_y if valid else y
        kalman.vy[lane] = new_v + predicted[3] * gain_x + after_x[1] * gain_y if valid else v
        P[0, lane] = corrected[0] if valid else mixed[0]
        P[1, lane] = corrected[1] if valid else mixed[1]
        P[2, lane] = corrected[2] if valid else mixed[2]
        P[3, lane] = corrected[3] if valid else mixed[3]
        P[4, lane] = corrected[4] if valid else mixed[4]
        P[5, lane] = corrected[5] if valid else mixed[5]
        P[6, lane] = corrected[6] if valid else mixed[6]
        P[7, lane] = corrected[7] if valid else mixed[7]
        P[8, lane] = corrected[8] if valid else mixed[8]
        P[9, lane] = corrected[9] if valid else mixed[9]
        likelihood = log_likelihood(white_x, white_y, log_variance) if valid else DIVERGED
        innovation.white_x[lane] = white_x if valid else 0.0
        innovation.white_y[lane] = white_y if valid else 0.0
        innovation.log_variance[lane] = log_variance if valid else 0.0
        kalman.log_likelihood[lane] = likelihood
        kalman.log_probability[lane] = log(prior) + likelihood


@internal
def _normalize(bank: ImmBank, first: int, last: int) -> None:
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
def _merge(bank: ImmBank, block: Any, first: int, last: int) -> None:
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


@internal
def step_imm(
    bank: ImmBank, block: Any, first: int, last: int, radii: NDArray[np.float64], model: Any
) -> None:
    """Advance every filter, its probability and the merged estimate of lanes first .. last - 1 by one tick.

    Args:
        bank: bank of the block.
        block: a record with the fields `measurement`, (2, LANES), and `estimate` and `covariance` of the
            merged estimate, (4, LANES) and (10, LANES).
        first, last: range of lanes.
        radii: (n,) turn radii of the bank [m].
        model: an `ImmModel`, or a record with its fields.
    """
    for h in range(bank.hypotheses.size):
        radius = signed_radius(h, radii)
        curvature = 0.0 if radius == 0.0 else 1.0 / radius
        _step_hypothesis(bank.hypotheses[h], bank.innovations[h], block, first, last, curvature, model)
    _normalize(bank, first, last)
    _merge(bank, block, first, last)
