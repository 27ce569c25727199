"""The anchor-aware bank: the likelihood of every turn includes the uncertainty of the anchor.

Centre and turn rate, which the published bank treats as exact, are part of the state of an extended
Kalman filter, see `extended_kalman`. The straight line is a turn of rate 0 whose centre and rate
have no variance. With an exact anchor the filters are the published ones with covariances between
the axes, which measurements of a radar need. A filter that diverges keeps its state and its
log-likelihood decreases, so that no NaN occurs.
"""

import math
from typing import Any

from hybrid_env.core.banks import extended_kalman as ekf
from hybrid_env.core.banks.bank import (
    covariance7,
    covariance_of,
    motion_at,
    motions_of,
    set_covariance,
    set_state,
    signed_radius,
    state_of,
)
from hybrid_env.core.banks.kalman import weigh
from hybrid_env.core.banks.linear import predict_linear
from hybrid_env.core.banks.sensing import DIVERGED, LARGEST, correct_by_sensors
from hybrid_env.core.compilation import formula, internal
from hybrid_env.core.elementary import log
from hybrid_env.core.memory import AnchorAwareBank, FloatArray, Records, State, Triangle4
from hybrid_env.core.motion import bank_turn_rate, heading_vector, turn_centre
from hybrid_env.core.vectors import Vector, choose, combination, minus_square, rows_of, widened


@internal
def begin(
    bank: AnchorAwareBank,
    lane: int,
    anchor: State,
    covariance: Triangle4,
    radii: FloatArray,
    model: Any,
) -> None:
    """Start every filter of a lane from the anchor; arguments as in `published.begin`."""
    for h in range(bank.hypotheses.size):
        radius = signed_radius(h, radii)
        exact = model.exact_anchor > 0.0
        begin_hypothesis(bank.hypotheses[h], lane, anchor, covariance, radius, model.tau, exact)


@internal
def begin_hypothesis(
    kalman: Any,
    lane: int,
    anchor: State,
    covariance: Triangle4,
    radius: float,
    tau: float,
    exact: bool = False,
) -> None:
    """Start one filter of a lane from the anchor. radius: signed as in `signed_radius` [m]; exact:
    whether centre and turn rate have no variance.
    """
    speed, heading_x, heading_y = heading_vector(anchor[1], anchor[3])
    # Bounded: the heading of an object slower than its uncertainty deviates by about 1 rad at most.
    inverse_speed = 1.0 / max(speed, math.sqrt(covariance[4] + covariance[9]), 1e-12)
    kalman.log_likelihood[lane] = 0.0
    centre = turn_centre(anchor[0], anchor[2], heading_x, heading_y, radius)
    turn_rate = 0.0 if radius == 0.0 else bank_turn_rate(speed, abs(radius), tau)
    set_state(kalman, lane, anchor + centre + (turn_rate,))
    spread = ekf.anchor_covariance(covariance, heading_x, heading_y, inverse_speed, radius)
    set_covariance(kalman, lane, spread)
    if exact:
        # The entries of the centre and the turn rate.
        for k in (4, 5, 6, 10, 11, 12, 15, 16, 17, 19, 20, 21, 22, 23, 24, 25, 26, 27):
            kalman.covariance[k, lane] = 0.0


@formula
def predict_turn(kalman: Any, lane: int, model: Any) -> tuple[Vector, Vector]:
    """Return the predicted state of the filter of a turn and its covariance."""
    x, u, y, v, centre_x, centre_y, rate = state_of(kalman, lane)
    turn = ekf.turn_coefficients(rate, model.tau)
    C, S, W, _, dC, dS, dW = turn
    from_x = x - centre_x
    from_y = y - centre_y
    by_rate = dC * from_x + dS * u, dC * u - dW * from_x, dC * from_y + dS * v, dC * v - dW * from_y
    predicted = ekf.predict_covariance(covariance7(kalman, lane), turn, by_rate, model)
    state = (
        centre_x + C * from_x + S * u,
        C * u - W * from_x,
        centre_y + C * from_y + S * v,
        C * v - W * from_y,
        centre_x,
        centre_y,
        rate,
    )
    return state, predicted


@formula
def correct_hypothesis(
    kalman: Any,
    innovation: Any,
    lane: int,
    moved: tuple[Vector, Vector],
    measurement: FloatArray,
    model: Any,
) -> None:
    """Correct a filter by a position, (2, LANES) [m], and update its log-likelihood. moved:
    predicted state and covariance.
    """
    state = moved[0]
    predicted = widened(moved[1])
    variance_x, variance_y = model.variance_x, model.variance_y
    # Sequential corrections by x and y; the product of both densities is the joint density.
    by_x, by_u, _, by_v, _, _, _ = rows_of(predicted)
    innovation_x = measurement[0, lane] - state[0]
    sigma_x = by_x[0] + variance_x
    inverse_x = 1.0 / sigma_x
    gain_x = innovation_x * inverse_x
    # The row of the measured coordinate is K R, which avoids cancellation.
    left_x = combination((variance_x * inverse_x,), (by_x,))
    after_x = left_x + minus_square(predicted, by_x, inverse_x)[7:]
    _, _, by_y, _, _, _, _ = rows_of(after_x)
    innovation_y = measurement[1, lane] - (state[2] + by_x[2] * gain_x)
    sigma_y = by_y[2] + variance_y
    inverse_y = 1.0 / sigma_y
    gain_y = innovation_y * inverse_y
    left_y = combination((variance_y * inverse_y,), (by_y,))
    p = minus_square(after_x, by_y, inverse_y)
    covariance = p[:2] + left_y[:1] + p[3:8] + left_y[1:2] + p[9:13] + left_y[2:] + p[18:]
    white_x = innovation_x * math.sqrt(inverse_x)
    white_y = innovation_y * math.sqrt(inverse_y)
    log_variance = 0.5 * (log(sigma_x) + log(sigma_y))

    # These comparisons are False for NaN and for values that would lead to NaN.
    innovations = abs(innovation_x) + abs(innovation_y)
    valid = (
        (sigma_x + sigma_y < LARGEST * LARGEST)
        & (by_u[1] + by_v[3] < LARGEST * LARGEST)
        & (innovations + abs(state[1]) + abs(state[3]) < LARGEST)
    )
    weight, likelihood = weigh(white_x, white_y, log_variance, model.freedom)
    corrected = combination((1.0, weight * gain_x, weight * gain_y), (state, by_x, by_y))
    innovation.white_x[lane] = white_x if valid else 0.0
    innovation.white_y[lane] = white_y if valid else 0.0
    innovation.log_variance[lane] = log_variance if valid else 2.0 * math.log(LARGEST)
    kalman.log_likelihood[lane] += likelihood if valid else -DIVERGED
    set_state(kalman, lane, choose(valid, corrected, state_of(kalman, lane)))
    before = covariance7(kalman, lane)
    set_covariance(kalman, lane, choose(valid, covariance, before))


@formula
def _predict(kalman: Any, lane: int, motion: Any, model: Any) -> tuple[Vector, Vector]:
    """Return the predicted state of a filter and its covariance; motion: None is a turn."""
    if motion is not None and motion.linear:
        return predict_linear(kalman, lane, motion)
    return predict_turn(kalman, lane, model)


@internal
def step_motion(
    kalman: Any,
    innovation: Any,
    first: int,
    last: int,
    motion: Any,
    measurement: FloatArray,
    model: Any,
) -> None:
    """Advance one filter and its log-likelihood by one tick; arguments as in `published.step`.
    motion: a record `MOTION`; None is straight motion or a turn.
    """
    if motion is not None and motion.linear:
        for lane in range(first, last):
            moved = predict_linear(kalman, lane, motion)
            correct_hypothesis(kalman, innovation, lane, moved, measurement, model)
    else:
        for lane in range(first, last):
            moved = predict_turn(kalman, lane, model)
            correct_hypothesis(kalman, innovation, lane, moved, measurement, model)


@internal
def step(
    bank: Any, lowest: int, stop: int, first: int, last: int, measurement: FloatArray, model: Any
) -> None:
    """Advance filters lowest .. stop - 1 of lanes first .. last - 1 by one tick; see
    `published.step`.
    """
    # A loop that begins at another number is slower.
    for h in range(bank.hypotheses.size):
        if h < lowest or h >= stop:
            continue
        motion = motion_at(motions_of(bank), h)
        kalman, innovation = bank.hypotheses[h], bank.innovations[h]
        step_motion(kalman, innovation, first, last, motion, measurement, model)


@internal
def sense(
    bank: Any, lane: int, lowest: int, stop: int, block: Any, sensors: Records, model: Any
) -> None:
    """Advance filters lowest .. stop - 1 of a lane by one tick without a measurement, or by all
    that the sensors measure; see `sensing.correct_by_sensors`.
    """
    for h in range(lowest, stop):
        kalman, innovation = bank.hypotheses[h], bank.innovations[h]
        moved = _predict(kalman, lane, motion_at(motions_of(bank), h), model)
        sense_predicted(kalman, innovation, lane, moved, block, sensors, model)


@internal
def sense_predicted(
    kalman: Any,
    innovation: Any,
    lane: int,
    moved: tuple[Vector, Vector],
    block: Any,
    sensors: Records,
    model: Any,
) -> None:
    """Set one filter of a lane to its prediction, and correct it by all that is measured. moved:
    predicted state and covariance.
    """
    state, predicted = moved
    # Also False for NaN: a filter that diverges keeps its state.
    valid = (predicted[0] + predicted[13] < LARGEST * LARGEST) & (
        predicted[7] + predicted[18] < LARGEST * LARGEST
    )
    if valid & (abs(state[1]) + abs(state[3]) < LARGEST):
        set_state(kalman, lane, state)
        set_covariance(kalman, lane, predicted)
    sigma_x = (predicted[0] if valid else 0.0) + model.variance_x
    sigma_y = (predicted[13] if valid else 0.0) + model.variance_y
    innovation.white_x[lane] = innovation.white_y[lane] = 0.0
    innovation.log_variance[lane] = 0.5 * (log(sigma_x) + log(sigma_y))
    if math.isnan(block.measurement[0, lane]):
        return
    before, p = state_of(kalman, lane), covariance7(kalman, lane)
    corrected, p, measured, fits = correct_by_sensors(before, p, block, lane, sensors, model)
    set_state(kalman, lane, corrected)
    set_covariance(kalman, lane, p)
    innovation.white_x[lane], innovation.white_y[lane] = measured[0], measured[1]
    innovation.log_variance[lane] = measured[2] if fits else 2.0 * math.log(LARGEST)
    kalman.log_likelihood[lane] += measured[3] if fits else -DIVERGED


@internal
def sense_motion(
    kalman: Any,
    innovation: Any,
    first: int,
    last: int,
    motion: Any,
    block: Any,
    sensors: Records,
    model: Any,
) -> None:
    """Advance one filter by one tick of any kind: without a measurement, or with those of sensors.
    motion: as in `step_motion`; block: with the fields of `memory.MEASURED`; without sensors all
    lanes or none are NaN.
    """
    if sensors.size == 0 and not math.isnan(block.measurement[0, first]):
        step_motion(kalman, innovation, first, last, motion, block.measurement, model)
        return
    for lane in range(first, last):
        moved = _predict(kalman, lane, motion, model)
        sense_predicted(kalman, innovation, lane, moved, block, sensors, model)


@internal
def sense_hypothesis(
    kalman: Any, innovation: Any, first: int, last: int, block: Any, sensors: Records, model: Any
) -> None:
    """Advance the filter of straight motion or a turn by one tick of any kind."""
    sense_motion(kalman, innovation, first, last, None, block, sensors, model)


@internal
def predicted_position(
    bank: Any, hypothesis: int, lane: int, model: Any
) -> tuple[float, float, float, float, float]:
    """Return the predicted position x, y of one hypothesis before a tick [m], and its covariance
    xx, xy, yy [m^2].
    """
    motion = motion_at(motions_of(bank), hypothesis)
    state, p = _predict(bank.hypotheses[hypothesis], lane, motion, model)
    return state[0], state[2], p[0], p[2], p[13]


@internal
def covariance(bank: Any, hypothesis: int, lane: int) -> Triangle4:
    """Return the covariance of [x, vx, y, vy] of one hypothesis, upper triangle row by row."""
    return covariance_of(bank.hypotheses[hypothesis], lane)
