"""The anchor-aware bank: the likelihood of every turn includes the uncertainty of the anchor.

Centre and turn rate, which the published bank treats as exact, are part of the state of an extended
Kalman filter, see `extended_kalman`. The straight line is a turn of rate 0 whose centre and rate
have no variance. With an exact anchor the filters are the published ones with covariances between
the axes, which measurements of a radar need. A filter that diverges keeps its state and its
log-likelihood decreases, so that no NaN occurs.
"""

import math
from typing import Any

import numpy as np

from hybrid_env.core.banks import extended_kalman as ekf
from hybrid_env.core.banks.bank import signed_radius
from hybrid_env.core.banks.kalman import weigh
from hybrid_env.core.banks.sensing import DIVERGED, LARGEST, ROUNDING, correct_by_sensors
from hybrid_env.core.compilation import formula, internal
from hybrid_env.core.elementary import log
from hybrid_env.core.memory import (
    AnchorAwareBank,
    FloatArray,
    Records,
    State,
    Triangle4,
)
from hybrid_env.core.motion import bank_turn_rate, heading_vector, turn_centre
from hybrid_env.core.vectors import Vector, choose, combination, minus_square, rows_of


@internal
def of_block(banks: AnchorAwareBank, b: int) -> AnchorAwareBank:
    """Return the bank of one block from those of all blocks."""
    return AnchorAwareBank(banks.hypotheses[b], banks.innovations)


@internal
def motions_of(bank: AnchorAwareBank) -> None:
    """Return None: all modes are straight motion and turns."""
    return None


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
def covariance7(kalman: Any, lane: int) -> Vector:
    """Return the covariance of the seven states of one filter, upper triangle row by row."""
    P = kalman.covariance
    return (
        P[0, lane],
        P[1, lane],
        P[2, lane],
        P[3, lane],
        P[4, lane],
        P[5, lane],
        P[6, lane],
        P[7, lane],
        P[8, lane],
        P[9, lane],
        P[10, lane],
        P[11, lane],
        P[12, lane],
        P[13, lane],
        P[14, lane],
        P[15, lane],
        P[16, lane],
        P[17, lane],
        P[18, lane],
        P[19, lane],
        P[20, lane],
        P[21, lane],
        P[22, lane],
        P[23, lane],
        P[24, lane],
        P[25, lane],
        P[26, lane],
        P[27, lane],
    )


@formula
def set_covariance(kalman: Any, lane: int, p: Vector) -> None:
    """Set the covariance of the seven states of one filter."""
    P = kalman.covariance
    # Written out, because a loop over so many entries would not become SIMD code.
    P[0, lane] = p[0]
    P[1, lane] = p[1]
    P[2, lane] = p[2]
    P[3, lane] = p[3]
    P[4, lane] = p[4]
    P[5, lane] = p[5]
    P[6, lane] = p[6]
    P[7, lane] = p[7]
    P[8, lane] = p[8]
    P[9, lane] = p[9]
    P[10, lane] = p[10]
    P[11, lane] = p[11]
    P[12, lane] = p[12]
    P[13, lane] = p[13]
    P[14, lane] = p[14]
    P[15, lane] = p[15]
    P[16, lane] = p[16]
    P[17, lane] = p[17]
    P[18, lane] = p[18]
    P[19, lane] = p[19]
    P[20, lane] = p[20]
    P[21, lane] = p[21]
    P[22, lane] = p[22]
    P[23, lane] = p[23]
    P[24, lane] = p[24]
    P[25, lane] = p[25]
    P[26, lane] = p[26]
    P[27, lane] = p[27]


@formula
def state_of(kalman: Any, lane: int) -> Vector:
    """Return the state of one filter."""
    estimate = kalman.x[lane], kalman.vx[lane], kalman.y[lane], kalman.vy[lane]
    return (*estimate, kalman.centre_x[lane], kalman.centre_y[lane], kalman.turn_rate[lane])


@formula
def set_state(kalman: Any, lane: int, state: Vector) -> None:
    """Set the state of one filter."""
    kalman.x[lane], kalman.vx[lane], kalman.y[lane], kalman.vy[lane] = state[:4]
    kalman.centre_x[lane], kalman.centre_y[lane], kalman.turn_rate[lane] = state[4:]


@formula
def predict_hypothesis(kalman: Any, lane: int, model: Any) -> tuple[Vector, Vector]:
    """Return the predicted state of a filter and its covariance."""
    x, u, y, v, centre_x, centre_y, rate = state_of(kalman, lane)
    turn = ekf.turn_coefficients(rate, model.tau)
    C, S, W, _, dC, dS, dW = turn
    from_x = x - centre_x
    from_y = y - centre_y
    by_rate = dC * from_x + dS * u, dC * u - dW * from_x, dC * from_y + dS * v, dC * v - dW * from_y
    predicted = ekf.predict_covariance(
        covariance7(kalman, lane),
        turn,
        by_rate,
        model.process_variance,
    )
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
    state, predicted = moved
    variance_x, variance_y = model.variance_x, model.variance_y
    # Sequential corrections by x and y; the product of both densities is the joint density.
    by_x, by_u, _, by_v, _, _, _ = rows_of(predicted)
    innovation_x = measurement[0, lane] - state[0]
    sigma_x = by_x[0] + variance_x
    inverse_x = 1.0 / sigma_x
    gain_x = innovation_x * inverse_x
    after_x = minus_square(predicted, by_x, inverse_x)
    _, _, by_y, _, _, _, _ = rows_of(after_x)
    innovation_y = measurement[1, lane] - (state[2] + by_x[2] * gain_x)
    sigma_y = by_y[2] + variance_y
    inverse_y = 1.0 / sigma_y
    gain_y = innovation_y * inverse_y
    covariance = minus_square(after_x, by_y, inverse_y)
    white_x = innovation_x * math.sqrt(inverse_x)
    white_y = innovation_y * math.sqrt(inverse_y)
    log_variance = 0.5 * (log(sigma_x) + log(sigma_y))

    # These comparisons are False for NaN and for values that would lead to NaN.
    innovations = abs(innovation_x) + abs(innovation_y)
    valid = (
        (sigma_x > 0.5 * variance_x)
        & (sigma_y > 0.5 * variance_y)
        & (sigma_x + sigma_y < LARGEST * LARGEST)
        & (by_u[1] + by_v[3] < LARGEST * LARGEST)
        & (innovations + abs(state[1]) + abs(state[3]) < LARGEST)
        & (covariance[7] >= -ROUNDING * by_u[1])
        & (covariance[18] >= -ROUNDING * by_v[3])
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


@internal
def step_hypothesis(
    kalman: Any,
    innovation: Any,
    first: int,
    last: int,
    measurement: FloatArray,
    model: Any,
) -> None:
    """Advance one filter and its log-likelihood by one tick; arguments as in `published.step`."""
    for lane in range(first, last):
        moved = predict_hypothesis(kalman, lane, model)
        correct_hypothesis(kalman, innovation, lane, moved, measurement, model)


@internal
def step(
    bank: AnchorAwareBank,
    first: int,
    last: int,
    measurement: FloatArray,
    model: Any,
) -> None:
    """Advance every filter of lanes first .. last - 1 by one tick; see
    `published.step`.
    """
    for h in range(bank.hypotheses.size):
        step_hypothesis(bank.hypotheses[h], bank.innovations[h], first, last, measurement, model)


@internal
def follow(
    bank: AnchorAwareBank,
    lane: int,
    hypothesis: int,
    measurement: FloatArray,
    model: Any,
) -> None:
    """Advance the filter of one hypothesis of a lane by one tick, without its log-likelihood."""
    kalman = bank.hypotheses[hypothesis]
    before = kalman.log_likelihood[lane]
    step_hypothesis(
        kalman,
        bank.innovations[hypothesis],
        np.uint64(lane),
        np.uint64(lane + 1),
        measurement,
        model,
    )
    kalman.log_likelihood[lane] = before


@internal
def sense(
    bank: AnchorAwareBank,
    lane: int,
    first: int,
    last: int,
    block: Any,
    sensors: Records,
    model: Any,
) -> None:
    """Advance filters first .. last - 1 of a lane by one tick without a measurement, or by all that
    the sensors measure; see `sensing.correct_by_sensors`.
    """
    for h in range(first, last):
        moved = predict_hypothesis(bank.hypotheses[h], lane, model)
        sense_predicted(bank.hypotheses[h], bank.innovations[h], lane, moved, block, sensors, model)


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
    sigma_x = max(predicted[0] if valid else 0.0, 0.0) + model.variance_x
    sigma_y = max(predicted[13] if valid else 0.0, 0.0) + model.variance_y
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
def sense_hypothesis(
    kalman: Any,
    innovation: Any,
    first: int,
    last: int,
    block: Any,
    sensors: Records,
    model: Any,
) -> None:
    """Advance one filter by one tick of any kind: without a measurement, or with those of sensors.
    block: with the fields of `memory.MEASURED`; without sensors all lanes or none are NaN.
    """
    if sensors.size == 0 and not math.isnan(block.measurement[0, first]):
        step_hypothesis(kalman, innovation, first, last, block.measurement, model)
        return
    for lane in range(first, last):
        moved = predict_hypothesis(kalman, lane, model)
        sense_predicted(kalman, innovation, lane, moved, block, sensors, model)


@internal
def predicted_position(
    bank: AnchorAwareBank,
    hypothesis: int,
    lane: int,
    model: Any,
) -> tuple[float, float, float, float, float]:
    """Return the predicted position x, y of one hypothesis before a tick [m], and its covariance
    xx, xy, yy [m^2].
    """
    state, p = predict_hypothesis(bank.hypotheses[hypothesis], lane, model)
    return state[0], state[2], p[0], p[2], p[13]


@internal
def covariance(bank: AnchorAwareBank, hypothesis: int, lane: int) -> Triangle4:
    """Return the covariance of [x, vx, y, vy] of one hypothesis, upper triangle row by row."""
    return covariance_of(bank.hypotheses[hypothesis], lane)


@internal
def covariance_of(kalman: Any, lane: int) -> Triangle4:
    """Return the covariance of [x, vx, y, vy] of one filter, upper triangle row by row."""
    p = covariance7(kalman, lane)
    return p[:4] + p[7:10] + p[13:15] + p[18:19]
