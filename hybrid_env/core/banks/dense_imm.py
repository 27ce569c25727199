"""The interacting multiple model (IMM) bank of modes of the user, for any transition matrix. Blom &
Bar-Shalom 1988, with the steps of `imm`.

A filter has the states of `dense`. A mode without accelerations sets them to 0. A turn of a radius
is a coordinated turn by the estimated speed, and a mode with an acceleration along the heading has
that of the estimated heading; both are then treated as known, as in `imm`.
"""

import math
from typing import Any

import numpy as np

from hybrid_env.core.banks import imm
from hybrid_env.core.banks.anchor_aware import correct_hypothesis, sense_predicted
from hybrid_env.core.banks.bank import covariance7, covariance_of, set_covariance, set_state
from hybrid_env.core.banks.bank import state_of as state7
from hybrid_env.core.banks.linear import in_seven, predict_linear
from hybrid_env.core.banks.mixture import NEGLIGIBLE, merge, normalize
from hybrid_env.core.compilation import formula, internal
from hybrid_env.core.elementary import exp, log
from hybrid_env.core.memory import (
    DenseImmBank,
    FloatArray,
    Records,
    Triangle4,
    state_of,
    triangle_of,
)
from hybrid_env.core.motion import heading_vector
from hybrid_env.core.vectors import Vector, combination, minus_square, widened

NO_STATE: Vector = (0.0,) * 7
NO_COVARIANCE: Vector = (0.0,) * 28
# Probability of a mode that no transition leads to.
UNREACHABLE = 1e-300


@formula
def _without_accelerations(p: Triangle4) -> Vector:
    """Return the covariance of [x, vx, y, vy] as that of seven states, of which the last are 0."""
    zeros = (0.0, 0.0)
    first = p[:4] + zeros + p[4:7] + zeros + p[7:9] + zeros + p[9:] + zeros
    return in_seven((*first, 0.0, 0.0, 0.0))


@internal
def begin_imm(bank: DenseImmBank, block: Any, lane: int, known: int) -> None:
    """Start every filter of a lane from the merged estimate of the block; see `imm.begin_imm`."""
    covariance = _without_accelerations(triangle_of(block.covariance, lane))
    for h in range(bank.hypotheses.size):
        kalman = bank.hypotheses[h]
        set_state(kalman, lane, (*state_of(block.estimate, lane), 0.0, 0.0, 0.0))
        set_covariance(kalman, lane, covariance)
        if known < 0:
            kalman.log_probability[lane] = -math.log(bank.hypotheses.size)
        else:
            kalman.log_probability[lane] = 0.0 if h == known else NEGLIGIBLE


@formula
def _brought(kalman: Any, lane: int, stays: bool) -> tuple[Vector, Vector]:
    """Return state and covariance that a filter brings to a mode; at a switch to another mode
    without accelerations.
    """
    if stays:
        return state7(kalman, lane), covariance7(kalman, lane)
    estimate = kalman.x[lane], kalman.vx[lane], kalman.y[lane], kalman.vy[lane]
    return (*estimate, 0.0, 0.0, 0.0), _without_accelerations(covariance_of(kalman, lane))


@internal
def _mix(bank: DenseImmBank, h: int, first: int, last: int) -> None:
    """Write the prior probability of mode h in the tick and the mixed initial condition of its
    filter to `mixed`. Blom & Bar-Shalom 1988, interaction step.
    """
    mixed = bank.mixed[h]
    modes = bank.hypotheses.size
    for lane in range(first, last):
        mixed.log_probability[lane] = 0.0
        set_state(mixed, lane, NO_STATE)
        set_covariance(mixed, lane, NO_COVARIANCE)
    for g in range(modes):
        kalman = bank.hypotheses[g]
        for lane in range(first, last):
            probability = exp(max(kalman.log_probability[lane], NEGLIGIBLE))
            mixed.log_probability[lane] += bank.transitions[g, h] * probability
    for lane in range(first, last):
        mixed.log_probability[lane] = log(max(mixed.log_probability[lane], UNREACHABLE))
    own = bank.hypotheses[h]
    for g in range(modes):
        kalman = bank.hypotheses[g]
        for lane in range(first, last):
            before = max(kalman.log_probability[lane], NEGLIGIBLE)
            weight = bank.transitions[g, h] * exp(before - mixed.log_probability[lane])
            state, p = _brought(kalman, lane, g == h)
            # Differences to the filter of the mode itself lose no digits far from the origin.
            difference = combination((1.0, -1.0), (state, state7(own, lane)))
            square = minus_square(p, difference, -1.0)
            sums = combination((1.0, weight), (covariance7(mixed, lane), square))
            set_state(mixed, lane, combination((1.0, weight), (state7(mixed, lane), difference)))
            set_covariance(mixed, lane, sums)
    for lane in range(first, last):
        difference = state7(mixed, lane)
        p = widened(covariance7(mixed, lane))
        set_covariance(mixed, lane, minus_square(p, difference, 1.0))
        set_state(mixed, lane, combination((1.0, 1.0), (difference, state7(own, lane))))


@internal
def _predict(mixed: Any, first: int, last: int, motion: Any, model: Any) -> None:
    """Replace the initial condition of a filter of lanes first .. last - 1 by its prediction."""
    if motion.signed_radius != 0.0:
        curvature = 1.0 / motion.signed_radius
        for lane in range(first, last):
            estimate, p = state7(mixed, lane)[:4], covariance_of(mixed, lane)
            moved, predicted = imm.predict(estimate, p, curvature, model)
            set_state(mixed, lane, (*moved, 0.0, 0.0, 0.0))
            set_covariance(mixed, lane, _without_accelerations(predicted))
        return
    if motion.acceleration != 0.0:
        acceleration = motion.acceleration
        for lane in range(first, last):
            _, heading_x, heading_y = heading_vector(mixed.vx[lane], mixed.vy[lane])
            mixed.centre_x[lane] = acceleration * heading_x
            mixed.centre_y[lane] = acceleration * heading_y
            set_covariance(mixed, lane, _without_accelerations(covariance_of(mixed, lane)))
    for lane in range(first, last):
        state, predicted = predict_linear(mixed, lane, motion)
        set_state(mixed, lane, state)
        set_covariance(mixed, lane, predicted)


@internal
def _advance(
    bank: DenseImmBank, block: Any, first: int, last: int, sensors: Records | None, model: Any
) -> None:
    """Advance every filter, its probability and the merged estimate of lanes first .. last - 1 by
    one tick. sensors: what has measured, if anything; None is a position of variance R.
    """
    for h in range(bank.hypotheses.size):
        _mix(bank, h, first, last)
    for h in range(bank.hypotheses.size):
        kalman, mixed, innovation = bank.hypotheses[h], bank.mixed[h], bank.innovations[h]
        _predict(mixed, first, last, bank.motions[h], model)
        for lane in range(first, last):
            kalman.log_likelihood[lane] = 0.0
            moved = state7(mixed, lane), covariance7(mixed, lane)
            if sensors is None:
                correct_hypothesis(kalman, innovation, lane, moved, block.measurement, model)
            else:
                sense_predicted(kalman, innovation, lane, moved, block, sensors, model)
            likelihood = kalman.log_likelihood[lane]
            kalman.log_probability[lane] = mixed.log_probability[lane] + likelihood
    normalize(bank, first, last)
    merge(bank, block, first, last, covariance_of)


@internal
def step_imm(
    bank: DenseImmBank, block: Any, first: int, last: int, radii: FloatArray, model: Any
) -> None:
    """Advance lanes first .. last - 1 by one tick; see `imm.step_imm`. radii: not used."""
    _advance(bank, block, first, last, None, model)


@internal
def sense_imm(
    bank: DenseImmBank, block: Any, lane: int, radii: FloatArray, sensors: Records, model: Any
) -> None:
    """Advance a lane by one tick; see `imm.sense_imm`. radii: not used."""
    _advance(bank, block, np.uint64(lane), np.uint64(lane + 1), sensors, model)
