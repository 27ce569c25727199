"""The bank of modes of the user with announced switches: one small Kalman filter for every mode,
with all covariances between the states.

Straight motion and turns of a radius have the filter of the anchor-aware bank. A linear mode x' =
F x + B + w has the states [x, vx, y, vy, ax, ay] in the first six places of such a filter. Its
accelerations at the switch are 0, or for a mode with an acceleration along the heading that of the
anchor's heading, whose uncertainty they inherit. With an exact anchor they have no variance.
"""

import math
from typing import Any

import numpy as np

from hybrid_env.core.banks import anchor_aware
from hybrid_env.core.compilation import formula, internal
from hybrid_env.core.memory import DenseBank, FloatArray, Records, State, Triangle4
from hybrid_env.core.motion import heading_vector, linear_motion, rows_of_matrix
from hybrid_env.core.vectors import Vector, combination, rows_of, sandwich, transposed

# Upper triangle row by row.
Triangle6 = Vector


@internal
def of_block(banks: DenseBank, b: int) -> DenseBank:
    """Return the bank of one block from those of all blocks."""
    return DenseBank(banks.hypotheses[b], banks.innovations, banks.motions)


@internal
def motions_of(bank: DenseBank) -> Records:
    """Return the modes, records `MOTION`."""
    return bank.motions


@formula
def triangle6(matrix: FloatArray) -> Triangle6:
    """Return the upper triangle of a matrix, (6, 6), row by row."""
    a, b, c, d, e, f = rows_of_matrix(matrix)
    return a + b[1:] + c[2:] + d[3:] + e[4:] + f[5:]


@formula
def predict_covariance(p: Triangle6, motion: Any) -> Triangle6:
    """Return F P F' + Q of a linear mode, a record `MOTION`."""
    moved = sandwich(rows_of_matrix(motion.F), p)
    return combination((1.0, 1.0), (moved, triangle6(motion.Q)))


@formula
def acceleration_covariance(
    covariance: Triangle4,
    heading_x: float,
    heading_y: float,
    slope: float,
) -> Triangle6:
    """Return J P J', the covariance of [x, vx, y, vy, ax, ay] at a switch, from the covariance P of
    the anchor; J is their Jacobian by the anchor. heading: unit vector; slope: acceleration over
    the speed of the anchor [1/s].
    """
    x, u, y, v = rows_of(covariance)
    # Derivatives of the accelerations by the velocities.
    a = slope * heading_y * heading_y
    b = -slope * heading_x * heading_y
    c = slope * heading_x * heading_x
    by_x, by_u, by_y, by_v = transposed((combination((a, b), (u, v)), combination((b, c), (u, v))))
    xx, xy = combination((a, b), (by_u, by_v))
    _, yy = combination((b, c), (by_u, by_v))
    return x + by_x + u[1:] + by_u + y[2:] + by_y + v[3:] + by_v + (xx, xy, yy)


@formula
def in_seven(p: Triangle6) -> Vector:
    """Return the covariance of six states as that of seven, of which the last is 0."""
    zero = (0.0,)
    first = p[:6] + zero + p[6:11] + zero + p[11:15] + zero
    return first + p[15:18] + zero + p[18:20] + zero + p[20:] + zero + zero


@formula
def _of_seven(p: Vector) -> Triangle6:
    """Return the covariance of the first six states of seven."""
    return p[:6] + p[7:12] + p[13:17] + p[18:21] + p[22:24] + p[25:26]


@internal
def begin_motion(
    kalman: Any,
    lane: int,
    anchor: State,
    covariance: Triangle4,
    motion: Any,
    model: Any,
) -> None:
    """Start the filter of a mode; see `anchor_aware.begin_hypothesis`."""
    exact = model.exact_anchor > 0.0
    if not motion.linear:
        radius = motion.signed_radius
        anchor_aware.begin_hypothesis(kalman, lane, anchor, covariance, radius, model.tau, exact)
        return
    speed, heading_x, heading_y = heading_vector(anchor[1], anchor[3])
    # Bounded as in `anchor_aware.begin_hypothesis`.
    least = max(speed, math.sqrt(covariance[4] + covariance[9]), 1e-12)
    kalman.log_likelihood[lane] = 0.0
    acceleration = motion.acceleration
    along = acceleration * heading_x, acceleration * heading_y
    anchor_aware.set_state(kalman, lane, anchor + along + (0.0,))
    slope = 0.0 if exact else acceleration / least
    spread = acceleration_covariance(covariance, heading_x, heading_y, slope)
    anchor_aware.set_covariance(kalman, lane, in_seven(spread))


@internal
def begin(
    bank: DenseBank,
    lane: int,
    anchor: State,
    covariance: Triangle4,
    radii: FloatArray,
    model: Any,
) -> None:
    """Start every filter of a lane from the anchor; arguments as in `published.begin`."""
    for h in range(bank.hypotheses.size):
        begin_motion(bank.hypotheses[h], lane, anchor, covariance, bank.motions[h], model)


@formula
def predict_linear(kalman: Any, lane: int, motion: Any) -> tuple[Vector, Vector]:
    """Return the predicted state of the filter of a linear mode and its covariance."""
    state = linear_motion(motion, anchor_aware.state_of(kalman, lane)[:6])
    predicted = predict_covariance(_of_seven(anchor_aware.covariance7(kalman, lane)), motion)
    return (*state, 0.0), in_seven(predicted)


@internal
def _predict(kalman: Any, lane: int, motion: Any, model: Any) -> tuple[Vector, Vector]:
    """Return the predicted state of one filter and its covariance."""
    if motion.linear:
        return predict_linear(kalman, lane, motion)
    return anchor_aware.predict_hypothesis(kalman, lane, model)


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
    """Advance the filter of a mode by one tick; see `anchor_aware.step_hypothesis`."""
    if not motion.linear:
        anchor_aware.step_hypothesis(kalman, innovation, first, last, measurement, model)
        return
    for lane in range(first, last):
        moved = predict_linear(kalman, lane, motion)
        anchor_aware.correct_hypothesis(kalman, innovation, lane, moved, measurement, model)


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
    """Advance the filter of a mode by one tick of any kind; see `anchor_aware.sense_hypothesis`."""
    if sensors.size == 0 and not math.isnan(block.measurement[0, first]):
        step_motion(kalman, innovation, first, last, motion, block.measurement, model)
        return
    for lane in range(first, last):
        moved = _predict(kalman, lane, motion, model)
        anchor_aware.sense_predicted(kalman, innovation, lane, moved, block, sensors, model)


@internal
def step(
    bank: DenseBank,
    first: int,
    last: int,
    measurement: FloatArray,
    model: Any,
) -> None:
    """Advance every filter of lanes first .. last - 1 by one tick; see `published.step`."""
    for h in range(bank.hypotheses.size):
        kalman, innovation, motion = bank.hypotheses[h], bank.innovations[h], bank.motions[h]
        step_motion(kalman, innovation, first, last, motion, measurement, model)


@internal
def follow(
    bank: DenseBank,
    lane: int,
    hypothesis: int,
    measurement: FloatArray,
    model: Any,
) -> None:
    """Advance the filter of one hypothesis of a lane by one tick, without its log-likelihood."""
    kalman = bank.hypotheses[hypothesis]
    before = kalman.log_likelihood[lane]
    first, last = np.uint64(lane), np.uint64(lane + 1)
    innovation, motion = bank.innovations[hypothesis], bank.motions[hypothesis]
    step_motion(kalman, innovation, first, last, motion, measurement, model)
    kalman.log_likelihood[lane] = before


@internal
def sense(
    bank: DenseBank,
    lane: int,
    first: int,
    last: int,
    block: Any,
    sensors: Records,
    model: Any,
) -> None:
    """Advance filters first .. last - 1 of a lane by one tick without a measurement, or by all that
    the sensors measure; see `anchor_aware.sense`.
    """
    for h in range(first, last):
        kalman, innovation = bank.hypotheses[h], bank.innovations[h]
        moved = _predict(kalman, lane, bank.motions[h], model)
        anchor_aware.sense_predicted(kalman, innovation, lane, moved, block, sensors, model)


@internal
def predicted_position(
    bank: DenseBank,
    hypothesis: int,
    lane: int,
    model: Any,
) -> tuple[float, float, float, float, float]:
    """Return the predicted position x, y of one hypothesis before a tick [m], and its covariance
    xx, xy, yy [m^2].
    """
    motion = bank.motions[hypothesis]
    state, p = _predict(bank.hypotheses[hypothesis], lane, motion, model)
    return state[0], state[2], p[0], p[2], p[13]


@internal
def covariance(bank: DenseBank, hypothesis: int, lane: int) -> Triangle4:
    """Return the covariance of [x, vx, y, vy] of one hypothesis, upper triangle row by row."""
    return anchor_aware.covariance_of(bank.hypotheses[hypothesis], lane)
