"""The anchor-aware bank with announced switches: the likelihood of every turn includes the
uncertainty of the anchor.

Centre and turn rate, which the published bank treats as exact, are states of its filters, see
`filter.predict_turn`. The straight line is a turn of rate 0 whose centre and rate have no variance.
A linear mode of the user has its accelerations in the places of the centre: at the switch they are
0, or for a mode with an acceleration along the heading that of the anchor's heading, whose
uncertainty they inherit. With an exact anchor nothing but [x, vx, y, vy] has a variance: these are
the published filters with covariances between the axes, which sensors need. A filter that diverges
keeps its state and its log-likelihood decreases, so that no NaN occurs.
"""

import math
from typing import Any

from hybrid_env.core.arrays import AnyArray, FloatArray
from hybrid_env.core.banks.bank import (
    alike,
    covariance_of,
    motion_at,
    motions_of,
    radius_of,
    read_filter,
    write_filter,
)
from hybrid_env.core.banks.filter import (
    Corrected,
    Filter,
    correct,
    of_four,
    of_seven,
    predict_linear,
    predict_straight,
    predict_turn,
)
from hybrid_env.core.banks.sensing import correct_by_sensors
from hybrid_env.core.compilation import apart, internal, stay_apart
from hybrid_env.core.memory import State, Triangle4
from hybrid_env.core.motion import bank_turn_rate, heading_vector, turn_centre
from hybrid_env.core.vectors import Vector, combination, rows_of, transposed


@internal
def begin(
    bank: Any, lane: int, anchor: State, covariance: Triangle4, radii: FloatArray, model: Any
) -> None:
    """Start every filter of a lane from the anchor; arguments as in `published.begin`."""
    for h in range(bank.hypotheses.size):
        motion = motion_at(motions_of(bank), h)
        radius = radius_of(motion, h, radii)
        _begin(bank.hypotheses[h], lane, anchor, covariance, radius, motion, model)


@internal
def _least_speed(speed: float, covariance: Triangle4) -> float:
    """Return the speed of an anchor by which its heading deviates: that of an object slower than
    its uncertainty deviates by about 1 rad at most.
    """
    return max(speed, math.sqrt(covariance[4] + covariance[9]), 1e-12)


@internal
def begin_turn(
    kalman: Any, lane: int, anchor: State, covariance: Triangle4, radius: float, model: Any
) -> None:
    """Start the filter of straight motion or a turn from the anchor. radius: signed as in
    `signed_radius` [m].
    """
    speed, heading_x, heading_y = heading_vector(anchor[1], anchor[3])
    kalman.log_likelihood[lane] = 0.0
    centre = turn_centre(anchor[0], anchor[2], heading_x, heading_y, radius)
    turn_rate = 0.0 if radius == 0.0 else bank_turn_rate(speed, abs(radius), model.tau)
    spread = of_seven(covariance)
    if radius != 0.0 and model.exact_anchor == 0.0:
        inverse_speed = 1.0 / _least_speed(speed, covariance)
        spread = _turn_covariance(covariance, heading_x, heading_y, inverse_speed, radius)
    write_filter(kalman, lane, anchor + centre + (turn_rate,), spread)


@internal
def _turn_covariance(
    covariance: Triangle4, heading_x: float, heading_y: float, inverse_speed: float, radius: float
) -> Vector:
    """Return J P J', the covariance of the seven states at the switch, from the covariance P of the
    anchor; J is their Jacobian by the anchor. heading: unit vector; inverse_speed: 1 / speed [s/m],
    bounded; radius: signed [m].
    """
    x, u, y, v = rows_of(covariance)
    # Derivatives of the centre (x - radius * heading_y, y + radius * heading_x) by the velocities.
    a = radius * heading_x * heading_y * inverse_speed
    b = -radius * heading_x * heading_x * inverse_speed
    c = radius * heading_y * heading_y * inverse_speed
    # Derivatives of the turn rate.
    p, q = heading_x / abs(radius), heading_y / abs(radius)
    # Rows of J P of the centre and the turn rate, and its columns.
    centre_x = combination((1.0, a, b), (x, u, v))
    centre_y = combination((1.0, c, -a), (y, u, v))
    rate = combination((p, q), (u, v))
    by_x, by_u, by_y, by_v = transposed((centre_x, centre_y, rate))
    # Columns of J P J' of the centre and the turn rate.
    xx, _, _ = combination((1.0, a, b), (by_x, by_u, by_v))
    xy, yy, _ = combination((1.0, c, -a), (by_y, by_u, by_v))
    xr, yr, rr = combination((p, q), (by_u, by_v))
    return x + by_x + u[1:] + by_u + y[2:] + by_y + v[3:] + by_v + (xx, xy, xr, yy, yr, rr)


@internal
def _acceleration_covariance(
    covariance: Triangle4, heading_x: float, heading_y: float, slope: float
) -> Vector:
    """Return the same for [x, vx, y, vy, ax, ay, 0]. slope: acceleration over the speed of the
    anchor [1/s].
    """
    x, u, y, v = rows_of(covariance)
    # Derivatives of the accelerations by the velocities.
    a = slope * heading_y * heading_y
    b = -slope * heading_x * heading_y
    c = slope * heading_x * heading_x
    by_x, by_u, by_y, by_v = transposed((combination((a, b), (u, v)), combination((b, c), (u, v))))
    xx, xy = combination((a, b), (by_u, by_v))
    _, yy = combination((b, c), (by_u, by_v))
    return of_seven(x + by_x + u[1:] + by_u + y[2:] + by_y + v[3:] + by_v + (xx, xy, yy))


@internal
def begin_motion(
    kalman: Any, lane: int, anchor: State, covariance: Triangle4, motion: Any, model: Any
) -> None:
    """Start the filter of a mode, a record `MOTION`, from the anchor."""
    _begin(kalman, lane, anchor, covariance, motion.signed_radius, motion, model)


@internal
def _begin(
    kalman: Any,
    lane: int,
    anchor: State,
    covariance: Triangle4,
    radius: float,
    motion: Any,
    model: Any,
) -> None:
    """Start the filter of a mode with a radius from the anchor; motion: None is a turn."""
    if motion is None or not motion.linear:
        begin_turn(kalman, lane, anchor, covariance, radius, model)
        return
    speed, heading_x, heading_y = heading_vector(anchor[1], anchor[3])
    kalman.log_likelihood[lane] = 0.0
    acceleration = motion.acceleration
    along = acceleration * heading_x, acceleration * heading_y
    slope = acceleration / _least_speed(speed, covariance)
    slope = 0.0 if model.exact_anchor > 0.0 else slope
    spread = _acceleration_covariance(covariance, heading_x, heading_y, slope)
    write_filter(kalman, lane, anchor + along + (0.0,), spread)


@internal
def _write(kalman: Any, innovation: Any, lane: int, corrected: Corrected) -> None:
    """Set a filter to what it is after a measurement."""
    state, p, told, likelihood = corrected
    write_filter(kalman, lane, state, p)
    innovation.white_x[lane], innovation.white_y[lane], innovation.log_variance[lane] = told
    kalman.log_likelihood[lane] += likelihood


@internal
def _predicted(before: Filter, motion: Any, model: Any) -> Filter:
    """Return a filter one tick later; motion: None is a turn."""
    if motion is not None and motion.linear:
        return predict_linear(before[0], before[1], motion)
    return predict_turn(before[0], before[1], model)


@apart
def _step_by_sensors(
    kalman: Any,
    innovation: Any,
    first: int,
    last: int,
    motion: Any,
    measured: Any,
    sensors: AnyArray,
    model: Any,
) -> None:
    """Do what `step_motion` does, of all that is measured."""
    stay_apart()
    for lane in range(first, last):
        before = read_filter(kalman, lane)
        moved = _predicted(before, motion, model)
        after = correct_by_sensors(before, moved, motion, measured, lane, sensors, model)
        _write(kalman, innovation, lane, after)


@internal
def step_motion(
    kalman: Any,
    innovation: Any,
    first: int,
    last: int,
    motion: Any,
    measured: Any,
    sensors: AnyArray,
    model: Any,
) -> None:
    """Advance one filter and its log-likelihood by one tick; arguments as in `published.step`.
    motion: a record `MOTION`; None is straight motion or a turn.
    """
    at_once = alike(measured, first, last, sensors, model)
    _step_motion(kalman, innovation, first, last, motion, measured, sensors, model, at_once)


@internal
def _step_motion(
    kalman: Any,
    innovation: Any,
    first: int,
    last: int,
    motion: Any,
    measured: Any,
    sensors: AnyArray,
    model: Any,
    at_once: bool,
) -> None:
    """Do the same; at_once: from `alike`."""
    if not at_once:
        _step_by_sensors(kalman, innovation, first, last, motion, measured, sensors, model)
    elif motion is not None and motion.linear:
        for lane in range(first, last):
            before = read_filter(kalman, lane)
            moved = predict_linear(before[0], before[1], motion)
            after = correct(before, moved, measured.measurement, lane, model)
            _write(kalman, innovation, lane, after)
    else:
        for lane in range(first, last):
            before = read_filter(kalman, lane)
            moved = predict_turn(before[0], before[1], model)
            after = correct(before, moved, measured.measurement, lane, model)
            _write(kalman, innovation, lane, after)


@internal
def _step_straight(
    kalman: Any, innovation: Any, first: int, last: int, measured: Any, model: Any
) -> None:
    """Do what `step_motion` does of straight motion without a drift, with the same bits in less
    time; all that is measured are positions.
    """
    for lane in range(first, last):
        state, p = read_filter(kalman, lane)
        moved = predict_straight(state, p, model)
        before = state[:4], of_four(p)
        after, p, told, likelihood = correct(before, moved, measured.measurement, lane, model)
        _write(kalman, innovation, lane, (after + state[4:], of_seven(p), told, likelihood))


@internal
def step(
    bank: Any,
    lowest: int,
    stop: int,
    first: int,
    last: int,
    measured: Any,
    sensors: AnyArray,
    model: Any,
) -> None:
    """Advance filters lowest .. stop - 1 of lanes first .. last - 1 by one tick; see
    `published.step`.
    """
    at_once = alike(measured, first, last, sensors, model)
    # A loop that begins at another number is slower.
    for h in range(bank.hypotheses.size):
        if h < lowest or h >= stop:
            continue
        motion = motion_at(motions_of(bank), h)
        kalman, innovation = bank.hypotheses[h], bank.innovations[h]
        # A drift gives the centre a variance, and other roundings where measurements are missing.
        if motion is None and h == 0 and at_once and model.drift_variance == 0.0:
            _step_straight(kalman, innovation, first, last, measured, model)
            continue
        _step_motion(kalman, innovation, first, last, motion, measured, sensors, model, at_once)


@internal
def predicted_position(
    bank: Any, hypothesis: int, lane: int, model: Any
) -> tuple[float, float, float, float, float]:
    """Return the predicted position x, y of one hypothesis before a tick [m], and its covariance
    xx, xy, yy [m^2].
    """
    before = read_filter(bank.hypotheses[hypothesis], lane)
    state, p = _predicted(before, motion_at(motions_of(bank), hypothesis), model)
    return state[0], state[2], p[0], p[2], p[13]


@internal
def covariance(bank: Any, hypothesis: int, lane: int) -> Triangle4:
    """Return the covariance of [x, vx, y, vy] of one hypothesis, upper triangle row by row."""
    return covariance_of(bank.hypotheses[hypothesis], lane)
