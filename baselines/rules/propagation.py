"""Propagation of the error that the anchor will have at the next switch.

The object moves by one hypothesis, and the environment lets its filter of the declared hypothesis
run on. Both are linear but for the turn rate. Their joint normal distribution is propagated tick by
tick, and gives the error of the estimate for this hypothesis.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from hybrid_env.checks import AnyArray, FloatArray, IntArray
from hybrid_env.compiled import (
    FilterModel,
    State,
    compiled,
    internal,
    sense_hypothesis,
    turn_coefficients,
)

# Of a filter: [x, vx, y, vy, centre_x, centre_y, turn_rate].
STATES = 7
# Entries of y in a covariance of the seven states, upper triangle row by row.
OF_Y = 2, 8, 13, 14, 15, 16, 17


class Memory(NamedTuple):
    """Temporary memory of a propagation."""

    # (14, 14) covariance of the seven states of the object and of the bank's filter.
    joint: FloatArray
    # (14,)
    mean: FloatArray
    # (2, 7) covariances of x and y of the bank's filter.
    measured_rows: FloatArray
    # (5, 14) from deviations of the states to error and speed.
    frame: FloatArray
    # (1,) record `AWARE_HYPOTHESIS`
    kalman: AnyArray
    # (1,) record `INNOVATION`
    innovation: AnyArray
    # (1,) record `MEASURED`
    measured: AnyArray


@internal
def _read_filter(
    kalman: Any,
    lane: int,
    mean: FloatArray,
    covariance: FloatArray,
) -> None:
    """Write the seven states of a filter, (7,), and their covariance, (7, 7)."""
    mean[0] = kalman.x[lane]
    mean[1] = kalman.vx[lane]
    mean[2] = kalman.y[lane]
    mean[3] = kalman.vy[lane]
    mean[4] = kalman.centre_x[lane]
    mean[5] = kalman.centre_y[lane]
    mean[6] = kalman.turn_rate[lane]
    entry = 0
    for i in range(STATES):
        for j in range(i, STATES):
            covariance[i, j] = kalman.covariance[entry, lane]
            covariance[j, i] = covariance[i, j]
            entry += 1


@internal
def _mix_rows(
    rows: FloatArray,
    position: int,
    centre: int,
    rate: int,
    turn: State,
    by_rate: tuple[float, float],
) -> None:
    """Replace the rows of a position and its velocity by combinations of both, of the centre and of
    the turn rate.
    """
    C, S, W, D = turn
    p = rows[position]
    v = rows[position + 1]
    c = rows[centre]
    moved = C * p + S * v + D * c + by_rate[0] * rows[rate]
    rows[position + 1] = C * v + W * (c - p) + by_rate[1] * rows[rate]
    rows[position] = moved


@internal
def _move(
    joint: FloatArray,
    mean: FloatArray,
    first: int,
    tau: float,
) -> None:
    """Move the seven states from `first` on by a tick, linearised in the turn rate."""
    rate = first + 6
    C, S, W, D, dC, dS, dW = turn_coefficients(mean[rate], tau)
    turn = (C, S, W, D)
    for axis in range(2):
        position = first + 2 * axis
        centre = first + 4 + axis
        offset = mean[position] - mean[centre]
        velocity = mean[position + 1]
        by_rate = (dC * offset + dS * velocity, dC * velocity - dW * offset)
        mean[position] = mean[centre] + C * offset + S * velocity
        mean[position + 1] = C * velocity - W * offset
        _mix_rows(
            joint,
            position,
            centre,
            rate,
            turn,
            by_rate,
        )
        _mix_rows(
            joint.T,
            position,
            centre,
            rate,
            turn,
            by_rate,
        )


@internal
def _correct_rows(rows: FloatArray, gains: FloatArray) -> None:
    """Add the gains times (position of the object - that of the filter) to the rows of the
    filter.
    """
    x = rows[0] - rows[STATES]
    y = rows[2] - rows[STATES + 2]
    for j in range(STATES):
        rows[STATES + j] += gains[0, j] * x + gains[1, j] * y


@internal
def _tick(
    memory: Memory,
    lane: int,
    precision: FloatArray,
    noise: FloatArray,
    sensors: AnyArray,
    model: FilterModel,
) -> None:
    """Advance object and filter by a tick with a measurement. precision: (2, 2) inverse of its
    covariance in the model of the filter; noise: (2, 2) covariance of its errors.
    """
    joint = memory.joint
    mean = memory.mean
    kalman = memory.kalman[0]
    _move(joint, mean, 0, model.tau)
    _move(joint, mean, STATES, model.tau)
    joint[1, 1] += model.process_variance
    joint[3, 3] += model.process_variance
    memory.measured[0].measurement[0, lane] = mean[0]
    memory.measured[0].measurement[1, lane] = mean[2]
    sense_hypothesis(
        kalman,
        memory.innovation[0],
        np.uint64(lane),
        np.uint64(lane + 1),
        memory.measured[0],
        sensors,
        model,
    )
    # K = P H' / R with the corrected P.
    for j in range(STATES):
        memory.measured_rows[0, j] = kalman.covariance[j, lane]
        memory.measured_rows[1, j] = kalman.covariance[OF_Y[j], lane]
    gains = precision @ memory.measured_rows
    x = mean[0] - mean[STATES]
    y = mean[2] - mean[STATES + 2]
    mean[STATES:] += gains[0] * x + gains[1] * y
    _correct_rows(joint, gains)
    _correct_rows(joint.T, gains)
    joint[STATES:, STATES:] += gains.T @ (noise @ gains)


@internal
def _write_error(result: FloatArray, memory: Memory) -> None:
    """Write the mean error (4,) of the anchor in its heading frame, its mean speed, and their
    covariance (5, 5), to first order in the deviations of the states.
    """
    mean = memory.mean
    frame = memory.frame
    speed = max(math.hypot(mean[STATES + 1], mean[STATES + 3]), 1e-12)
    c = mean[STATES + 1] / speed
    s = mean[STATES + 3] / speed
    frame[:] = 0.0
    # Position, then velocity.
    for j in range(2):
        x = mean[j] - mean[STATES + j]
        y = mean[j + 2] - mean[STATES + j + 2]
        along = c * x + s * y
        across = c * y - s * x
        result[j] = along
        result[j + 2] = across
        frame[j, j] = c
        frame[j, j + 2] = s
        frame[j + 2, j] = -s
        frame[j + 2, j + 2] = c
        frame[:4, STATES + j] = -frame[:4, j]
        frame[:4, STATES + j + 2] = -frame[:4, j + 2]
    # The heading deviates too.
    for j in range(4):
        turned = result[j + 2] if j < 2 else -result[j - 2]
        frame[j, STATES + 1] -= turned * s / speed
        frame[j, STATES + 3] += turned * c / speed
    result[4] = speed
    frame[4, STATES + 1] = c
    frame[4, STATES + 3] = s
    result[5:] = (frame @ (memory.joint @ frame.T)).ravel()


@compiled
def propagate(
    results: FloatArray,
    courses: IntArray,
    noise: FloatArray,
    ratios: FloatArray,
    filters: AnyArray,
    bank: AnyArray,
    sensors: AnyArray,
    model: FilterModel,
    memory: Memory,
) -> None:
    """Write what `_write_error` does, (K, 30), of K courses, (K, 8): assumption, block, hypothesis
    and lane of a filter of the decider; block, declared hypothesis and lane of the bank; ticks to
    the switch. noise: (K, 3), covariance of a measurement xx, xy, yy over R, and `ratios` of that
    of the errors by the assumptions.
    """
    R = np.empty((2, 2))
    for k in range(len(courses)):
        assumption, block, h, lane, bank_block, declared, bank_lane, ticks = courses[k]
        memory.kalman[0] = bank[bank_block, declared]
        memory.joint[:] = 0.0
        # Its covariance is replaced by that of the object: the state of the bank is known.
        _read_filter(
            memory.kalman[0],
            bank_lane,
            memory.mean[STATES:],
            memory.joint,
        )
        _read_filter(
            filters[assumption, block, h],
            lane,
            memory.mean[:STATES],
            memory.joint,
        )
        R[0, 0] = model.variance_x * noise[k, 0]
        R[0, 1] = model.variance_x * noise[k, 1]
        R[1, 0] = R[0, 1]
        R[1, 1] = model.variance_y * noise[k, 2]
        for row in range(3):
            memory.measured[0].noise[row, bank_lane] = noise[k, row]
        precision = np.linalg.inv(R)
        errors = ratios[assumption] * R
        for _ in range(ticks):
            _tick(
                memory,
                bank_lane,
                precision,
                errors,
                sensors,
                model,
            )
        _write_error(results[k], memory)
