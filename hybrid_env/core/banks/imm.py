"""The interacting multiple model (IMM) bank: filters that run on over switches at unknown moments.
Blom & Bar-Shalom 1988, "The interacting multiple model algorithm for systems with Markovian
switching coefficients".

Each of M hypotheses has a Kalman filter and a probability, whose logarithm is stored, so that none
is lost in an outlier. The mode is a Markov chain. A tick has three steps:

1. Mixing. Filter h starts from mean and covariance of the mixture of all filters, weighted by the
   probabilities of the modes before the tick, given the mode h in the tick. If all transition
   probabilities to other modes are equal, this is a mixture of two terms: its own estimate, with
   the probability w that the mode was h, and the merged estimate of all filters.
2. Every filter predicts, is corrected by the measurement, and gives its log-likelihood.
3. Mean and covariance of the mixture of all filters are the merged estimate.

In every tick of a coordinated turn the object turns by the angle a = speed * tau / radius about the
centre that follows from its velocity: Golubkov 2018, eq. (1), with the switch at the present tick.
Its filter therefore needs no anchor. The angle follows from the estimated velocity and is then
treated as known, because the turn rate of the object does not change with the process noise of a
segment. The bank of straight motion and turns with equal transitions, `ImmBank`, has filters of
[x, vx, y, vy]. Those of modes of the user have the seven states of `anchor_aware`: a mode without
accelerations sets them to 0, and one with an acceleration along the heading has that of the
estimated heading. A filter that diverges keeps its state and becomes unlikely, so that no NaN
occurs.
"""

import math
from typing import Any

from hybrid_env.core.arrays import AnyArray, FloatArray
from hybrid_env.core.banks.bank import (
    alike,
    motion_at,
    motions_of,
    radius_of,
    read_filter,
    write_estimate,
    write_filter,
)
from hybrid_env.core.banks.filter import (
    Corrected,
    Filter,
    correct,
    of_four,
    of_seven,
    predict_coordinated,
    predict_linear,
)
from hybrid_env.core.banks.height import (
    begin_heights,
    estimate_heights,
    heights_of,
    mix_heights,
    step_mixed_heights,
)
from hybrid_env.core.banks.posterior import compare, write_covariance, write_mean
from hybrid_env.core.banks.sensing import correct_by_sensors
from hybrid_env.core.compilation import apart, internal, selected, stay_apart
from hybrid_env.core.elementary import exp, log
from hybrid_env.core.memory import DenseImmBank, ImmBank, Triangle4, state_of, triangle_of
from hybrid_env.core.motion import heading_vector
from hybrid_env.core.vectors import combination, minus_square, widened

# Smaller log probabilities count as this one.
NEGLIGIBLE = -700.0


@internal
def _read_estimate(kalman: Any, lane: int) -> Filter:
    """Return estimate and covariance of [x, vx, y, vy] of a filter."""
    state, p = read_filter(kalman, lane)
    return state[:4], of_four(p)


@internal
def _write(kalman: Any, mixed: Any, innovation: Any, lane: int, corrected: Corrected) -> None:
    """Set a filter to what it is after a measurement, without normalizing its probability."""
    state, p, told, likelihood = corrected
    write_filter(kalman, lane, state, p)
    innovation.white_x[lane], innovation.white_y[lane], innovation.log_variance[lane] = told
    kalman.log_likelihood[lane] = likelihood
    kalman.log_probability[lane] = mixed.log_probability[lane] + likelihood


@internal
def _log_probability(kalman: Any) -> FloatArray:
    values: FloatArray = kalman.log_probability
    return values


@internal
def covariance(bank: Any, hypothesis: int, lane: int) -> Triangle4:
    """Return the covariance of [x, vx, y, vy] of one hypothesis, upper triangle row by row."""
    return _read_estimate(bank.hypotheses[hypothesis], lane)[1]


@internal
def begin_imm(bank: Any, block: Any, lane: int, known: int) -> None:
    """Start every filter of a lane from the merged estimate of the block. known: the mode before
    the first tick; -1 if it is not known, all equally probable.
    """
    for h in range(bank.hypotheses.size):
        kalman = bank.hypotheses[h]
        estimate, spread = state_of(block.estimate, lane), triangle_of(block.covariance, lane)
        write_estimate(kalman, lane, estimate, spread)
        if known < 0:
            kalman.log_probability[lane] = -math.log(bank.hypotheses.size)
        else:
            kalman.log_probability[lane] = 0.0 if h == known else NEGLIGIBLE
        kalman.log_likelihood[lane] = 0.0
    begin_heights(heights_of(bank), bank, block, lane)


@internal
def _mix_equally(bank: ImmBank, block: Any, first: int, last: int, model: Any) -> None:
    """Write the prior probability of every mode in the tick and the mixed initial condition of its
    filter to `mixed`, if the transition probabilities to all other modes are equal.
    """
    for h in range(bank.hypotheses.size):
        kalman, mixed = bank.hypotheses[h], bank.mixed[h]
        for lane in range(first, last):
            probability = exp(max(kalman.log_probability[lane], NEGLIGIBLE))
            from_itself = (model.stay_probability - model.switch_probability) * probability
            prior = from_itself + model.switch_probability
            weight = from_itself / prior
            merged = state_of(block.estimate, lane)
            estimate, spread = read_filter(kalman, lane)
            difference = combination((1.0, -1.0), (estimate, merged))
            mean = combination((1.0, weight), (merged, difference))
            # The covariance of a mixture of two normal distributions.
            spreads = spread, triangle_of(block.covariance, lane)
            within = combination((weight, 1.0 - weight), spreads)
            spread = minus_square(within, difference, -(weight * (1.0 - weight)))
            write_estimate(mixed, lane, mean, spread)
            mixed.log_probability[lane] = log(prior)


@internal
def _brought(kalman: Any, lane: int, stays: bool) -> Filter:
    """Return state and covariance that a filter brings to a mode; at a switch to another mode
    without accelerations.
    """
    state, p = read_filter(kalman, lane)
    if stays:
        return state, p
    return (*state[:4], 0.0, 0.0, 0.0), of_seven(of_four(p))


@internal
def _weight(bank: DenseImmBank, g: int, h: int, lane: int) -> float:
    """Return the probability that mode g was in the tick before, given that the next one is h."""
    before = max(bank.hypotheses[g].log_probability[lane], NEGLIGIBLE)
    return bank.transitions[g, h] * exp(before - bank.mixed[h].log_probability[lane])


@internal
def _mix_mode(bank: DenseImmBank, h: int, first: int, last: int) -> None:
    """Write the same for mode h and any transition matrix. Blom & Bar-Shalom 1988, interaction
    step.
    """
    mixed = bank.mixed[h]
    modes = bank.hypotheses.size
    nothing = (0.0,) * 28
    for lane in range(first, last):
        mixed.log_probability[lane] = 0.0
        write_filter(mixed, lane, nothing[:7], nothing)
    for g in range(modes):
        kalman = bank.hypotheses[g]
        for lane in range(first, last):
            probability = exp(max(kalman.log_probability[lane], NEGLIGIBLE))
            mixed.log_probability[lane] += bank.transitions[g, h] * probability
    for lane in range(first, last):
        # No transition may lead to the mode.
        mixed.log_probability[lane] = log(max(mixed.log_probability[lane], 1e-300))
    own = bank.hypotheses[h]
    for g in range(modes):
        kalman = bank.hypotheses[g]
        for lane in range(first, last):
            weight = _weight(bank, g, h, lane)
            state, p = _brought(kalman, lane, g == h)
            # Differences to the filter of the mode itself lose no digits far from the origin.
            difference = combination((1.0, -1.0), (state, read_filter(own, lane)[0]))
            square = minus_square(p, difference, -1.0)
            sums, spread = read_filter(mixed, lane)
            sums = combination((1.0, weight), (sums, difference))
            write_filter(mixed, lane, sums, combination((1.0, weight), (spread, square)))
    for lane in range(first, last):
        difference, p = read_filter(mixed, lane)
        state = combination((1.0, 1.0), (difference, read_filter(own, lane)[0]))
        write_filter(mixed, lane, state, minus_square(widened(p), difference, 1.0))
    if len(bank.heights) > 0:
        _mix_heights(bank, h, first, last)


@apart
def _mix_heights(bank: DenseImmBank, h: int, first: int, last: int) -> None:
    """Do the same for the heights."""
    stay_apart()
    for g in range(bank.hypotheses.size):
        for lane in range(first, last):
            bank.likelihoods[g, lane] = _weight(bank, g, h, lane)
    mix_heights(bank, h, first, last)


@internal
def _mix_by_matrix(bank: DenseImmBank, block: Any, first: int, last: int, model: Any) -> None:
    """Write the same for all modes."""
    for h in range(bank.hypotheses.size):
        _mix_mode(bank, h, first, last)


_mix = selected(lambda bank: _mix_by_matrix if "transitions" in bank.fields else _mix_equally)


@internal
def _predict(mixed: Any, first: int, last: int, curvature: float, motion: Any, model: Any) -> None:
    """Replace the initial condition of a filter of lanes first .. last - 1 by its prediction.
    curvature: of the mode [1/m], positive to the left; motion: a record `MOTION`; None is a turn.
    """
    if motion is None or curvature != 0.0:
        for lane in range(first, last):
            estimate, p = _read_estimate(mixed, lane)
            estimate, p = predict_coordinated(estimate, p, curvature, model)
            write_estimate(mixed, lane, estimate, p)
        return
    if motion.acceleration != 0.0:
        acceleration = motion.acceleration
        for lane in range(first, last):
            estimate, p = _read_estimate(mixed, lane)
            _, heading_x, heading_y = heading_vector(estimate[1], estimate[3])
            write_estimate(mixed, lane, estimate, p)
            mixed.centre_x[lane] = acceleration * heading_x
            mixed.centre_y[lane] = acceleration * heading_y
    for lane in range(first, last):
        state, p = read_filter(mixed, lane)
        state, p = predict_linear(state, p, motion)
        write_filter(mixed, lane, state, p)


@internal
def step_imm(
    bank: Any, block: Any, first: int, last: int, radii: FloatArray, sensors: AnyArray, model: Any
) -> None:
    """Advance every filter, its probability and the merged estimate of lanes first .. last - 1 by
    one tick. block: with the fields of `memory.MEASURED`, and `estimate` and `covariance` of the
    merged estimate. Without a measurement, NaN, the probabilities follow the Markov chain, and
    innovations are zero, with the variance of a measurement.
    """
    motions, at_once = motions_of(bank), alike(block, first, last, sensors, model)
    _mix(bank, block, first, last, model)
    for h in range(bank.hypotheses.size):
        kalman, mixed, innovation = bank.hypotheses[h], bank.mixed[h], bank.innovations[h]
        motion = motion_at(motions, h)
        radius = radius_of(motion, h, radii)
        curvature = 0.0 if radius == 0.0 else 1.0 / radius
        _predict(mixed, first, last, curvature, motion, model)
        if not at_once:
            for lane in range(first, last):
                before, moved = read_filter(kalman, lane), read_filter(mixed, lane)
                after = correct_by_sensors(before, moved, motion, block, lane, sensors, model)
                _write(kalman, mixed, innovation, lane, after)
        else:
            for lane in range(first, last):
                before, moved = read_filter(kalman, lane), read_filter(mixed, lane)
                after = correct(before, moved, block.measurement, lane, model)
                _write(kalman, mixed, innovation, lane, after)
    step_mixed_heights(heights_of(bank), bank, first, last, block.height, model)
    compare(bank, _log_probability, first, last)
    for h in range(bank.hypotheses.size):
        kalman = bank.hypotheses[h]
        for lane in range(first, last):
            # The first difference is exact where it matters, also for very small likelihoods.
            ratio = kalman.log_probability[lane] - bank.sums[0].largest[lane]
            kalman.log_probability[lane] = ratio + log(bank.sums[0].inverse[lane])
    write_mean(bank, block, first, last)
    write_covariance(bank, block, first, last, covariance)
    estimate_heights(heights_of(bank), bank, block, None, first, last)
