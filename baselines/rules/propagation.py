"""Propagation of the error that the anchor will have at the next switch.

The object moves by one hypothesis, and the environment lets its filter of the declared hypothesis
run on. Both are linear but for the turn rate. Their joint normal distribution is propagated tick by
tick, and gives the error of the estimate for this hypothesis.
"""

import math
from typing import Any

import numpy as np

from baselines.rules.component_filters import FilterRecords
from baselines.rules.measurements import copy_filter
from hybrid_env.checks import AnyArray, FloatArray, IntArray
from hybrid_env.compiled import FilterModel, compiled, internal, move_turn, state_of, step_motion

# States of a filter: [x, vx, y, vy, centre_x, centre_y, turn_rate].
FILTER_STATES = 7


@internal
def _read_filter(kalman: Any, lane: int, mean: FloatArray, covariance: FloatArray) -> None:
    """Write the seven states of a filter, (7,), and their covariance, (7, 7)."""
    for k, value in enumerate(state_of(kalman, lane)):
        mean[k] = value
    entry = 0
    for i in range(FILTER_STATES):
        for j in range(i, FILTER_STATES):
            covariance[i, j] = kalman.covariance[entry, lane]
            covariance[j, i] = covariance[i, j]
            entry += 1


@internal
def _move(mean: FloatArray, tau: float) -> FloatArray:
    """Move seven states, (7,), by a tick; return the Jacobian of the motion, (7, 7)."""
    before = mean[0], mean[1], mean[2], mean[3], mean[4], mean[5], mean[6]
    moved, (C, S, W, D), by_rate = move_turn(before, tau)
    jacobian = np.eye(FILTER_STATES)
    for k in range(4):
        mean[k] = moved[k]
        jacobian[k, 6] = by_rate[k]
    for axis in range(2):
        x = 2 * axis
        v = x + 1
        centre = 4 + axis
        jacobian[x, x] = jacobian[v, v] = C
        jacobian[x, v] = S
        jacobian[x, centre] = D
        jacobian[v, x] = -W
        jacobian[v, centre] = W
    return jacobian


@internal
def _tick(
    mean: FloatArray,
    joint: FloatArray,
    memory: FilterRecords,
    precision: FloatArray,
    noise: FloatArray,
    sensors: AnyArray,
    model: FilterModel,
) -> FloatArray:
    """Advance the states of object and filter, (14,), by a tick with a measurement; return their
    covariance, (14, 14), which was `joint`. precision: (2, 2) inverse of the covariance of the
    measurement in the model of the filter; noise: (2, 2) covariance of its errors.
    """
    kalman = memory.filters[0]
    measured = memory.measured[0]
    motion = np.zeros((2 * FILTER_STATES, 2 * FILTER_STATES))
    motion[:FILTER_STATES, :FILTER_STATES] = _move(mean[:FILTER_STATES], model.tau)
    motion[FILTER_STATES:, FILTER_STATES:] = _move(mean[FILTER_STATES:], model.tau)
    moved = motion @ joint @ motion.T
    moved[1, 1] += model.process_variance
    moved[3, 3] += model.process_variance
    measured.measurement[0, 0] = mean[0]
    measured.measurement[1, 0] = mean[2]
    first, last = np.uint64(0), np.uint64(1)
    step_motion(kalman, memory.innovations[0], first, last, None, measured, sensors, model)
    # K = P H' / R with the corrected P.
    # Entries of y in a covariance of the seven states, upper triangle row by row.
    of_y = 2, 8, 13, 14, 15, 16, 17
    of_measured = np.empty((2, FILTER_STATES))
    for j in range(FILTER_STATES):
        of_measured[0, j] = kalman.covariance[j, 0]
        of_measured[1, j] = kalman.covariance[of_y[j], 0]
    gains = precision @ of_measured
    correction = np.eye(2 * FILTER_STATES)
    # By the position x, y of the object less that of the bank's filter.
    for k in range(2):
        correction[FILTER_STATES:, 2 * k] += gains[k]
        correction[FILTER_STATES:, FILTER_STATES + 2 * k] -= gains[k]
    mean[:] = correction @ mean
    corrected = correction @ moved @ correction.T
    corrected[FILTER_STATES:, FILTER_STATES:] += gains.T @ (noise @ gains)
    return corrected


@internal
def _write_error(result: FloatArray, mean: FloatArray, joint: FloatArray) -> None:
    """Write the mean error (4,) of the anchor in its heading frame, its mean speed, and their
    covariance (5, 5), to first order in the deviations of the states.
    """
    vx = FILTER_STATES + 1
    vy = FILTER_STATES + 3
    speed = max(math.hypot(mean[vx], mean[vy]), 1e-12)
    c = mean[vx] / speed
    s = mean[vy] / speed
    turn = np.kron(np.array([[c, s], [-s, c]]), np.eye(2))
    error = turn @ (mean[:4] - mean[FILTER_STATES : FILTER_STATES + 4])
    # From deviations of the states to error and speed.
    frame = np.zeros((5, 2 * FILTER_STATES))
    frame[:4, :4] = turn
    frame[:4, FILTER_STATES : FILTER_STATES + 4] = -turn
    # The heading deviates too.
    turned = np.concatenate((error[2:], -error[:2])) / speed
    frame[:4, vx] -= turned * s
    frame[:4, vy] += turned * c
    frame[4, vx] = c
    frame[4, vy] = s
    result[:4] = error
    result[4] = speed
    result[5:] = (frame @ joint @ frame.T).ravel()


@compiled
def propagate_anchor(
    results: FloatArray,
    courses: IntArray,
    noise: FloatArray,
    ratios: FloatArray,
    filters: AnyArray,
    bank: AnyArray,
    sensors: AnyArray,
    model: FilterModel,
    memory: FilterRecords,
) -> None:
    """Write what `_write_error` does, (K, 30), of K courses, (K, 8): assumption, block, hypothesis
    and lane of a filter of the decider; block, declared hypothesis and lane of the bank; ticks to
    the switch. noise: (K, 3), covariance of a measurement xx, xy, yy over R, and `ratios` of that
    of the errors by the assumptions.
    """
    mean = np.empty(2 * FILTER_STATES)
    R = np.empty((2, 2))
    for k in range(len(courses)):
        assumption, block, h, lane, bank_block, declared, bank_lane, ticks = courses[k]
        copy_filter(bank[bank_block, declared], bank_lane, memory.filters[0], 0)
        joint = np.zeros((2 * FILTER_STATES, 2 * FILTER_STATES))
        # Its covariance is replaced by that of the object: the state of the bank is known.
        _read_filter(memory.filters[0], 0, mean[FILTER_STATES:], joint)
        _read_filter(filters[assumption, block, h], lane, mean[:FILTER_STATES], joint)
        R[0, 0] = model.variance_x * noise[k, 0]
        R[0, 1] = model.variance_x * noise[k, 1]
        R[1, 0] = R[0, 1]
        R[1, 1] = model.variance_y * noise[k, 2]
        for row in range(3):
            memory.measured[0].noise[row, 0] = noise[k, row]
        precision = np.linalg.inv(R)
        errors = ratios[assumption] * R
        for _ in range(ticks):
            joint = _tick(mean, joint, memory, precision, errors, sensors, model)
        _write_error(results[k], mean, joint)
