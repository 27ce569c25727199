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
from hybrid_env.core.banks.bank import set_estimate, signed_radius
from hybrid_env.core.banks.kalman import log_likelihood
from hybrid_env.core.banks.sensing import LARGEST, ROUNDING, correct_by_sensors
from hybrid_env.core.compilation import inlined, internal
from hybrid_env.core.elementary import log
from hybrid_env.core.memory import (
    AnchorAwareBank,
    FloatArray,
    Records,
    State,
    Triangle4,
    block_reader,
    reader,
    write_lane,
)
from hybrid_env.core.motion import bank_turn_rate, heading_vector, turn_centre

# Decrease of the log-likelihood per tick of a diverged filter.
DIVERGED = 1e3


aware_banks = reader(AnchorAwareBank)
aware_of_block = block_reader(AnchorAwareBank)


@internal
def begin_aware(
    bank: AnchorAwareBank,
    lane: int,
    anchor: State,
    covariance: Triangle4,
    radii: FloatArray,
    model: Any,
) -> None:
    """Start every filter of a lane from the anchor; arguments as in `begin_published`."""
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
    set_estimate(kalman, lane, anchor)
    kalman.log_likelihood[lane] = 0.0
    centre_x, centre_y = turn_centre(anchor[0], anchor[2], heading_x, heading_y, radius)
    kalman.centre_x[lane], kalman.centre_y[lane] = centre_x, centre_y
    kalman.turn_rate[lane] = 0.0 if radius == 0.0 else bank_turn_rate(speed, abs(radius), tau)
    spread = ekf.anchor_covariance(covariance, heading_x, heading_y, inverse_speed, radius)
    write_lane(kalman.covariance, lane, spread)
    if exact:
        # The entries of the centre and the turn rate.
        for k in (4, 5, 6, 10, 11, 12, 15, 16, 17, 19, 20, 21, 22, 23, 24, 25, 26, 27):
            kalman.covariance[k, lane] = 0.0


@inlined
def _covariance7(P: FloatArray, lane: int) -> ekf.Triangle7:
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


@inlined
def predict_hypothesis(
    kalman: Any,
    lane: int,
    model: Any,
) -> tuple[float, float, float, float, ekf.Triangle7]:
    """Return the predicted estimate (x, vx, y, vy) of a filter and its predicted covariance."""
    x, u, y, v = kalman.x[lane], kalman.vx[lane], kalman.y[lane], kalman.vy[lane]
    centre_x, centre_y = kalman.centre_x[lane], kalman.centre_y[lane]
    turn = ekf.turn_coefficients(kalman.turn_rate[lane], model.tau)
    C, S, W, _, dC, dS, dW = turn
    from_x = x - centre_x
    from_y = y - centre_y
    by_rate = dC * from_x + dS * u, dC * u - dW * from_x, dC * from_y + dS * v, dC * v - dW * from_y
    predicted = ekf.predict_covariance(
        _covariance7(kalman.covariance, lane),
        turn,
        by_rate,
        model.process_variance,
    )
    new_x = centre_x + C * from_x + S * u
    new_u = C * u - W * from_x
    new_y = centre_y + C * from_y + S * v
    new_v = C * v - W * from_y
    return new_x, new_u, new_y, new_v, predicted


@internal
def step_hypothesis(
    kalman: Any,
    innovation: Any,
    first: int,
    last: int,
    measurement: FloatArray,
    model: Any,
) -> None:
    """Advance one filter and its log-likelihood by one tick; arguments as in `step_published`."""
    P = kalman.covariance
    variance_x, variance_y = model.variance_x, model.variance_y
    for lane in range(first, last):
        x, u, y, v = kalman.x[lane], kalman.vx[lane], kalman.y[lane], kalman.vy[lane]
        centre_x, centre_y, rate = (
            kalman.centre_x[lane],
            kalman.centre_y[lane],
            kalman.turn_rate[lane],
        )
        p = _covariance7(P, lane)
        new_x, new_u, new_y, new_v, predicted = predict_hypothesis(kalman, lane, model)

        # Sequential corrections by x and y; the product of both densities is the joint density.
        k = (
            predicted[0],
            predicted[1],
            predicted[2],
            predicted[3],
            predicted[4],
            predicted[5],
            predicted[6],
        )
        innovation_x = measurement[0, lane] - new_x
        sigma_x = k[0] + variance_x
        inverse_x = 1.0 / sigma_x
        after_x = ekf.condition(predicted, k, inverse_x)
        m = after_x[2], after_x[8], after_x[13], after_x[14], after_x[15], after_x[16], after_x[17]
        gain_x = innovation_x * inverse_x
        innovation_y = measurement[1, lane] - (new_y + k[2] * gain_x)
        sigma_y = m[2] + variance_y
        inverse_y = 1.0 / sigma_y
        corrected = ekf.condition(after_x, m, inverse_y)
        gain_y = innovation_y * inverse_y
        white_x = innovation_x * math.sqrt(inverse_x)
        white_y = innovation_y * math.sqrt(inverse_y)
        log_variance = 0.5 * (log(sigma_x) + log(sigma_y))

        # These comparisons are False for NaN and for values that would lead to NaN.
        valid = (
            (sigma_x > 0.5 * variance_x)
            & (sigma_y > 0.5 * variance_y)
            & (sigma_x + sigma_y < LARGEST * LARGEST)
            & (predicted[7] + predicted[18] < LARGEST * LARGEST)
            & (abs(innovation_x) + abs(innovation_y) + abs(new_u) + abs(new_v) < LARGEST)
            & (corrected[7] > -ROUNDING * predicted[7])
            & (corrected[18] > -ROUNDING * predicted[18])
        )
        kalman.x[lane] = new_x + k[0] * gain_x + m[0] * gain_y if valid else x
        kalman.vx[lane] = new_u + k[1] * gain_x + m[1] * gain_y if valid else u
        kalman.y[lane] = new_y + k[2] * gain_x + m[2] * gain_y if valid else y
        kalman.vy[lane] = new_v + k[3] * gain_x + m[3] * gain_y if valid else v
        kalman.centre_x[lane] = centre_x + k[4] * gain_x + m[4] * gain_y if valid else centre_x
        kalman.centre_y[lane] = centre_y + k[5] * gain_x + m[5] * gain_y if valid else centre_y
        kalman.turn_rate[lane] = rate + k[6] * gain_x + m[6] * gain_y if valid else rate
        innovation.white_x[lane] = white_x if valid else 0.0
        innovation.white_y[lane] = white_y if valid else 0.0
        innovation.log_variance[lane] = log_variance if valid else 2.0 * math.log(LARGEST)
        kalman.log_likelihood[lane] += (
            log_likelihood(white_x, white_y, log_variance) if valid else -DIVERGED
        )
        # Written out, because a loop over so many entries would not become SIMD code.
        P[0, lane] = corrected[0] if valid else p[0]
        P[1, lane] = corrected[1] if valid else p[1]
        P[2, lane] = corrected[2] if valid else p[2]
        P[3, lane] = corrected[3] if valid else p[3]
        P[4, lane] = corrected[4] if valid else p[4]
        P[5, lane] = corrected[5] if valid else p[5]
        P[6, lane] = corrected[6] if valid else p[6]
        P[7, lane] = corrected[7] if valid else p[7]
        P[8, lane] = corrected[8] if valid else p[8]
        P[9, lane] = corrected[9] if valid else p[9]
        P[10, lane] = corrected[10] if valid else p[10]
        P[11, lane] = corrected[11] if valid else p[11]
        P[12, lane] = corrected[12] if valid else p[12]
        P[13, lane] = corrected[13] if valid else p[13]
        P[14, lane] = corrected[14] if valid else p[14]
        P[15, lane] = corrected[15] if valid else p[15]
        P[16, lane] = corrected[16] if valid else p[16]
        P[17, lane] = corrected[17] if valid else p[17]
        P[18, lane] = corrected[18] if valid else p[18]
        P[19, lane] = corrected[19] if valid else p[19]
        P[20, lane] = corrected[20] if valid else p[20]
        P[21, lane] = corrected[21] if valid else p[21]
        P[22, lane] = corrected[22] if valid else p[22]
        P[23, lane] = corrected[23] if valid else p[23]
        P[24, lane] = corrected[24] if valid else p[24]
        P[25, lane] = corrected[25] if valid else p[25]
        P[26, lane] = corrected[26] if valid else p[26]
        P[27, lane] = corrected[27] if valid else p[27]


@internal
def step_aware(
    bank: AnchorAwareBank,
    first: int,
    last: int,
    measurement: FloatArray,
    model: Any,
) -> None:
    """Advance every filter of lanes first .. last - 1 by one tick; see
    `published.step_published`.
    """
    for h in range(bank.hypotheses.size):
        step_hypothesis(bank.hypotheses[h], bank.innovations[h], first, last, measurement, model)


@internal
def follow_aware(
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
def predict_aware(bank: AnchorAwareBank, lane: int, model: Any) -> None:
    """Advance every filter of a lane by one tick without a measurement; see
    `published.predict_published`.
    """
    for h in range(bank.hypotheses.size):
        _predict_only(bank.hypotheses[h], bank.innovations[h], lane, model)


@internal
def _predict_only(kalman: Any, innovation: Any, lane: int, model: Any) -> None:
    """Advance one filter of a lane by one tick without a measurement."""
    x, u, y, v, predicted = predict_hypothesis(kalman, lane, model)
    # Also False for NaN: a filter that diverges keeps its state.
    valid = (predicted[0] + predicted[13] < LARGEST * LARGEST) & (
        predicted[7] + predicted[18] < LARGEST * LARGEST
    )
    if valid & (abs(u) + abs(v) < LARGEST):
        set_estimate(kalman, lane, (x, u, y, v))
        write_lane(kalman.covariance, lane, predicted)
    sigma_x = max(predicted[0] if valid else 0.0, 0.0) + model.variance_x
    sigma_y = max(predicted[13] if valid else 0.0, 0.0) + model.variance_y
    innovation.white_x[lane] = innovation.white_y[lane] = 0.0
    innovation.log_variance[lane] = 0.5 * (log(sigma_x) + log(sigma_y))


@internal
def correct_aware(
    bank: AnchorAwareBank,
    lane: int,
    hypothesis: int,
    block: Any,
    sensors: Records,
    model: Any,
) -> None:
    """Correct one filter of a lane after `predict_aware`; see `sensing.correct_by_sensors`."""
    _correct(bank.hypotheses[hypothesis], bank.innovations[hypothesis], lane, block, sensors, model)


@internal
def _correct(
    kalman: Any,
    innovation: Any,
    lane: int,
    block: Any,
    sensors: Records,
    model: Any,
) -> None:
    """Correct one predicted filter of a lane by all that is measured, and update its
    log-likelihood.
    """
    state = (
        kalman.x[lane],
        kalman.vx[lane],
        kalman.y[lane],
        kalman.vy[lane],
        kalman.centre_x[lane],
        kalman.centre_y[lane],
        kalman.turn_rate[lane],
    )
    predicted = _covariance7(kalman.covariance, lane)
    corrected, p, measured, valid = correct_by_sensors(
        state, predicted, block, lane, sensors, model
    )
    set_estimate(kalman, lane, (corrected[0], corrected[1], corrected[2], corrected[3]))
    kalman.centre_x[lane], kalman.centre_y[lane], kalman.turn_rate[lane] = (
        corrected[4],
        corrected[5],
        corrected[6],
    )
    write_lane(kalman.covariance, lane, p)
    innovation.white_x[lane], innovation.white_y[lane] = measured[0], measured[1]
    innovation.log_variance[lane] = measured[2] if valid else 2.0 * math.log(LARGEST)
    kalman.log_likelihood[lane] += measured[3] if valid else -DIVERGED


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
        _predict_only(kalman, innovation, lane, model)
        if not math.isnan(block.measurement[0, lane]):
            _correct(kalman, innovation, lane, block, sensors, model)


@internal
def predicted_position_aware(
    bank: AnchorAwareBank,
    hypothesis: int,
    lane: int,
    model: Any,
) -> tuple[float, float, float, float, float]:
    """Return the predicted position x, y of one hypothesis before a tick [m], and its covariance
    xx, xy, yy [m^2].
    """
    x, _, y, _, covariance = predict_hypothesis(bank.hypotheses[hypothesis], lane, model)
    return x, y, covariance[0], covariance[2], covariance[13]


@internal
def covariance_aware(bank: AnchorAwareBank, hypothesis: int, lane: int) -> Triangle4:
    """Return the covariance of [x, vx, y, vy] of one hypothesis, upper triangle row by row."""
    return covariance_of(bank.hypotheses[hypothesis], lane)


@internal
def covariance_of(kalman: Any, lane: int) -> Triangle4:
    """Return the covariance of [x, vx, y, vy] of one filter, upper triangle row by row."""
    P = kalman.covariance
    return (
        P[0, lane],
        P[1, lane],
        P[2, lane],
        P[3, lane],
        P[7, lane],
        P[8, lane],
        P[9, lane],
        P[13, lane],
        P[14, lane],
        P[18, lane],
    )
