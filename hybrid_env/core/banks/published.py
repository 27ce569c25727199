"""The published bank of Kalman filters, one per hypothesis: straight, left turns, right turns.
Golubkov 2018, eq. (2) and (4). Centre and turn rate are exact and the noise covariances diagonal,
so that a filter separates into two of (position, velocity), one per axis. Their covariances depend
on the turn rate but not on the data: the left and the right turn of a radius share them, and so do
both axes if their measurement variances are equal. With sensors or a robust likelihood the bank is
the anchor-aware one with an exact anchor.
"""

import math
from typing import Any

from hybrid_env.core.arrays import AnyArray, FloatArray
from hybrid_env.core.banks.bank import radius_column, set_estimate, signed_radius
from hybrid_env.core.banks.filter import condition_x, log_likelihood
from hybrid_env.core.compilation import internal
from hybrid_env.core.elementary import log
from hybrid_env.core.memory import PublishedBank, State, Triangle4
from hybrid_env.core.motion import (
    bank_turn_rate,
    heading_vector,
    motion_coefficients,
    propagate,
    turn_centre,
)
from hybrid_env.core.vectors import sandwich


@internal
def begin(
    bank: PublishedBank,
    lane: int,
    anchor: State,
    covariance: Triangle4,
    radii: FloatArray,
    model: Any,
) -> None:
    """Start every filter of a lane from the anchor, which also determines turn rates and centres.
    anchor: estimate [x, vx, y, vy] at the switch [m, m/s]; covariance: of it, whose entries between
    the axes are ignored; radii: (n,) of the bank [m]; model: a `FilterModel`, or a record with its
    fields.
    """
    x, vx, y, vy = anchor
    speed, heading_x, heading_y = heading_vector(vx, vy)
    for column in range(radii.size + 1):
        turn_rate = 0.0 if column == 0 else bank_turn_rate(speed, radii[column - 1], model.tau)
        motion = motion_coefficients(turn_rate, model.tau)
        for axis in range(bank.covariances.shape[0]):
            shared = bank.covariances[axis, column]
            shared.cosine[lane], shared.sine_velocity[lane], shared.sine_position[lane] = motion
            shared.xx[lane] = covariance[0] if axis == 0 else covariance[7]
            shared.xv[lane] = covariance[1] if axis == 0 else covariance[8]
            shared.vv[lane] = covariance[4] if axis == 0 else covariance[9]
    for h in range(bank.hypotheses.size):
        kalman = bank.hypotheses[h]
        set_estimate(kalman, lane, anchor)
        kalman.log_likelihood[lane] = 0.0
        centre_x, centre_y = turn_centre(x, y, heading_x, heading_y, signed_radius(h, radii))
        kalman.centre_x[lane], kalman.centre_y[lane] = centre_x, centre_y


@internal
def _predicted(shared: Any, lane: int, process_variance: float) -> tuple[float, float, float]:
    """Return the predicted covariance xx, xv, vv of (position, velocity) of one radius and axis
    [m^2, m^2/s, m^2/s^2].
    """
    C, S, W = shared.cosine[lane], shared.sine_velocity[lane], shared.sine_position[lane]
    p = shared.xx[lane], shared.xv[lane], shared.vv[lane]
    xx, xv, vv = sandwich(((C, S), (-W, C)), p)
    return xx, xv, vv + process_variance


@internal
def predict_estimate(kalman: Any, shared: Any, lane: int) -> State:
    """Return the predicted estimate [x, vx, y, vy] of a filter. Golubkov 2018, eq. (2)."""
    C = shared.cosine[lane]
    S = shared.sine_velocity[lane]
    W = shared.sine_position[lane]
    x, vx = propagate(kalman.x[lane], kalman.vx[lane], kalman.centre_x[lane], C, S, W)
    y, vy = propagate(kalman.y[lane], kalman.vy[lane], kalman.centre_y[lane], C, S, W)
    return x, vx, y, vy


@internal
def step(
    bank: PublishedBank,
    lowest: int,
    stop: int,
    first: int,
    last: int,
    measured: Any,
    sensors: AnyArray,
    model: Any,
) -> None:
    """Advance filters lowest .. stop - 1, all or one, and their log-likelihoods of lanes first ..
    last - 1 by one tick. Golubkov 2018, eq. (2) and (4). measured: a record with the fields of
    `memory.MEASURED`; without a measurement, NaN, the filters are only predicted. sensors: none.
    """
    measurement = measured.measurement
    axes, columns = bank.covariances.shape
    first_column = radius_column(lowest, columns - 1)
    last_column = radius_column(stop - 1, columns - 1)
    for axis in range(axes):
        variance = model.variance_x if axis == 0 else model.variance_y
        # A loop that begins at another number is slower.
        for column in range(columns):
            if column < first_column or column > last_column:
                continue
            shared = bank.covariances[axis, column]
            gain = bank.gains[axis, column]
            for lane in range(first, last):
                xx, xv, vv = _predicted(shared, lane, model.process_variance)
                # Sigma = H P H' + R.
                sigma = xx + variance
                seen = not math.isnan(measurement[0, lane])
                # Without a measurement nothing changes.
                inverse = 1.0 / sigma if seen else 0.0
                left = variance * inverse if seen else 1.0
                gain.gain_x[lane], gain.gain_v[lane] = xx * inverse, xv * inverse
                gain.whitener[lane] = math.sqrt(inverse)
                gain.log_variance[lane] = log(sigma)
                # Bounded below, so that rounding does not make the covariance indefinite if the
                # predicted variances are very large compared with R.
                least = gain.gain_v[lane] * gain.gain_v[lane] * variance
                xx, xv, vv = condition_x((xx, xv, vv), (xx, xv), left, inverse)
                shared.xx[lane], shared.xv[lane], shared.vv[lane] = xx, xv, max(vv, least)
    for h in range(bank.hypotheses.size):
        if h < lowest or h >= stop:
            continue
        kalman = bank.hypotheses[h]
        innovation = bank.innovations[h]
        column = radius_column(h, columns - 1)
        shared = bank.covariances[0, column]
        of_x = bank.gains[0, column]
        of_y = bank.gains[axes - 1, column]
        for lane in range(first, last):
            seen = not math.isnan(measurement[0, lane])
            x, vx, y, vy = predict_estimate(kalman, shared, lane)
            innovation_x = measurement[0, lane] - x if seen else 0.0
            innovation_y = measurement[1, lane] - y if seen else 0.0
            white_x = innovation_x * of_x.whitener[lane]
            white_y = innovation_y * of_y.whitener[lane]
            log_variance = 0.5 * (of_x.log_variance[lane] + of_y.log_variance[lane])
            kalman.x[lane] = x + of_x.gain_x[lane] * innovation_x
            kalman.vx[lane] = vx + of_x.gain_v[lane] * innovation_x
            kalman.y[lane] = y + of_y.gain_x[lane] * innovation_y
            kalman.vy[lane] = vy + of_y.gain_v[lane] * innovation_y
            innovation.white_x[lane] = white_x
            innovation.white_y[lane] = white_y
            innovation.log_variance[lane] = log_variance
            likelihood = log_likelihood(white_x, white_y, log_variance)
            kalman.log_likelihood[lane] += likelihood if seen else 0.0


@internal
def predicted_position(
    bank: PublishedBank, hypothesis: int, lane: int, model: Any
) -> tuple[float, float, float, float, float]:
    """Return the predicted position x, y of one hypothesis before a tick [m], and its covariance
    xx, xy, yy [m^2].
    """
    axes, columns = bank.covariances.shape
    column = radius_column(hypothesis, columns - 1)
    x, _, y, _ = predict_estimate(bank.hypotheses[hypothesis], bank.covariances[0, column], lane)
    variance_x, _, _ = _predicted(bank.covariances[0, column], lane, model.process_variance)
    variance_y, _, _ = _predicted(bank.covariances[axes - 1, column], lane, model.process_variance)
    return x, y, variance_x, 0.0, variance_y


@internal
def covariance(bank: PublishedBank, hypothesis: int, lane: int) -> Triangle4:
    """Return the covariance of [x, vx, y, vy] of one hypothesis, upper triangle row by row."""
    axes, columns = bank.covariances.shape
    column = radius_column(hypothesis, columns - 1)
    x = bank.covariances[0, column]
    y = bank.covariances[axes - 1, column]
    return (
        x.xx[lane],
        x.xv[lane],
        0.0,
        0.0,
        x.vv[lane],
        0.0,
        0.0,
        y.xx[lane],
        y.xv[lane],
        y.vv[lane],
    )
