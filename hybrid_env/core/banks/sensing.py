"""The correction of a filter by what the sensors measure: a position with any covariance, and
velocities, range rates, ranges and bearings. It is corrected by the coordinates along the principal
axes of the position's covariance, whose errors are independent, and then by one other number after
the other, linearised at the estimate corrected so far. The likelihood may be a robust one. A filter
has any number of states, see `filter`.
"""

import math
from typing import Any

import numpy as np

from hybrid_env.core.arrays import AnyArray, FloatArray
from hybrid_env.core.banks.filter import (
    DIVERGED,
    LARGEST,
    LOG_TWO_PI,
    Corrected,
    Filter,
    correct,
    uncorrected,
)
from hybrid_env.core.compilation import inlined, internal
from hybrid_env.core.elementary import log
from hybrid_env.core.memory import MOST_RATES, State
from hybrid_env.core.polar import BEARING, RANGE, VELOCITY_X, VELOCITY_Y, range_rate
from hybrid_env.core.vectors import Vector, combination, minus_square, rows_of, widened


@internal
def write_measured(block: Any, lane: int, measured: FloatArray) -> None:
    """Write what is measured to a lane of a record with the fields of `memory.MEASURED`. measured:
    (2,) position of variance R, or (9,) with covariance xx, xy, yy over R, range rates and
    velocities.
    """
    block.measurement[0, lane], block.measurement[1, lane] = measured[0], measured[1]
    for k in range(3):
        block.noise[k, lane] = measured[2 + k] if measured.size > 2 else (0.0 if k == 1 else 1.0)
    for k in range(MOST_RATES):
        block.rates[k, lane] = measured[5 + k] if measured.size > 2 else np.nan


@inlined
def principal_axes(xx: float, xy: float, yy: float) -> State:
    """Return cosine and sine of the first principal axis of a covariance, and the variances
    along both.
    """
    half = 0.5 * (xx - yy)
    mean = 0.5 * (xx + yy)
    length = math.sqrt(half * half + xy * xy)
    if length == 0.0:
        return 1.0, 0.0, xx, yy
    cosine = math.sqrt(0.5 * (1.0 + abs(half) / length))
    sine = 0.5 * xy / (length * cosine)
    larger = mean + length
    smaller = (xx * yy - xy * xy) / larger
    if half >= 0.0:
        return cosine, sine, larger, smaller
    return cosine, -sine, smaller, larger


@internal
def correct_scalar(
    state: Vector, p: Vector, h: State, innovation: float, variance: float
) -> tuple[Vector, Vector, tuple[float, float, bool]]:
    """Correct a filter by a measurement h . [x, vx, y, vy] with a variance; return it with the
    whitened innovation, the logarithm of its variance, and False if the filter has diverged.
    """
    a, b, c, d = h
    rows = rows_of(p)
    k = combination(h, rows[:4])
    sigma = a * k[0] + b * k[1] + c * k[2] + d * k[3] + variance
    # These comparisons are False for NaN and for values that would lead to NaN.
    valid = (
        (sigma > 0.5 * variance)
        & (sigma + rows[1][1] + rows[3][3] < LARGEST * LARGEST)
        & (abs(innovation) + abs(state[1]) + abs(state[3]) < LARGEST)
    )
    if not valid:
        return state, p, (0.0, 0.0, False)
    inverse = 1.0 / sigma
    # The widening exceeds the rounding errors of the difference, however small the variance.
    corrected = minus_square(widened(p), k, inverse)
    moved = combination((1.0, innovation * inverse), (state, k))
    return moved, corrected, (innovation * math.sqrt(inverse), log(sigma), True)


@inlined
def _rate_model(
    state: Vector, p: Vector, rate: float, sensor: Any, axis: int, stands: bool
) -> tuple[State, float, float]:
    """Return the derivatives of what is measured beside a position by [x, vx, y, vy], its
    innovation, and its variance. Near the radar the bearing is uncertain: what this adds to a range
    rate in second order adds to the variance. A mode that stands predicts rates and velocities of
    0, whatever its state.
    """
    kind = sensor.kinds[axis]
    variance = sensor.deviations[axis] * sensor.deviations[axis]
    if stands and kind <= VELOCITY_Y:
        return (0.0, 0.0, 0.0, 0.0), rate, variance
    if kind == VELOCITY_X:
        return (0.0, 1.0, 0.0, 0.0), rate - state[1], variance
    if kind == VELOCITY_Y:
        return (0.0, 0.0, 0.0, 1.0), rate - state[3], variance
    x, u, y, v = state[0] - sensor.x, state[1], state[2] - sensor.y, state[3]
    distance = max(math.hypot(x, y), 1e-150)
    along_x = x / distance
    along_y = y / distance
    if kind == RANGE:
        return (along_x, 0.0, along_y, 0.0), rate - distance, variance
    if kind == BEARING:
        # Within half a circle.
        turned = rate - math.atan2(y, x)
        turned -= 2.0 * math.pi * math.floor(turned / (2.0 * math.pi) + 0.5)
        return (-along_y / distance, 0.0, along_x / distance, 0.0), turned, variance
    expected = range_rate(x, y, u, v)
    by_x, by_u, by_y, by_v = rows_of(p)[:4]
    across = (
        along_y * along_y * by_x[0]
        - 2.0 * along_x * along_y * by_x[2]
        + along_x * along_x * by_y[2]
    )
    angle = min(max(across, 0.0) / (distance * distance), 1e6)
    added = angle * (0.5 * angle * (u * u + v * v) + max(by_u[1], 0.0) + max(by_v[3], 0.0))
    h = (u - along_x * expected) / distance, along_x, (v - along_y * expected) / distance, along_y
    return h, rate - expected, variance + added


@inlined
def _senses(measured: Any, lane: int, sensors: AnyArray) -> bool:
    """Return whether anything beside a position is measured."""
    for k in range(sensors.size):
        for row in range(sensors[k].rates):
            if not math.isnan(measured.rates[sensors[k].rate_row + row, lane]):
                return True
    return False


@internal
def correct_by_sensors(
    before: Filter,
    moved: Filter,
    motion: Any,
    measured: Any,
    lane: int,
    sensors: AnyArray,
    model: Any,
) -> Corrected:
    """Return a filter corrected by all that is measured in a tick: a position, and other numbers of
    the sensors, or by nothing; as `filter.correct`. measured: a record with the fields of
    `memory.MEASURED`; motion: a record `MOTION` of the mode; None is a turn.

    With a freedom > 0 innovations have a Student t distribution whose scale matrix is the
    innovation variance. All corrections of a tick have the weight (freedom + k) / (freedom + d^2),
    d^2 the squared whitened innovation of k values, at most 1: Agamennoni, Nieto & Nebot 2012,
    "Approximate inference in state-space models with heavy-tailed noise", with one iteration, and
    Lange, Little & Taylor 1989, eq. (4). The covariances stay those of the Kalman filter.
    """
    placed = not math.isnan(measured.measurement[0, lane])
    unseen = uncorrected(before, moved, model)
    if not (placed or _senses(measured, lane, sensors)):
        return unseen
    # With the rounding of lanes that are corrected at once.
    if sensors.size == 0 and model.freedom == 0.0:
        return correct(before, moved, measured.measurement, lane, model)
    cosine, sine, first, second = principal_axes(
        model.variance_x * measured.noise[0, lane],
        model.variance_x * measured.noise[1, lane],
        model.variance_y * measured.noise[2, lane],
    )
    after, q = moved
    stands = motion is not None and motion.stands
    valid = True
    white_first = 0.0
    white_second = 0.0
    log_variance = 0.0
    log_rates = 0.0
    distance = 0.0
    count = 0.0
    for k in range(-2 if placed else 0, 2 * sensors.size):
        if k < 0:
            h_x, h_y, variance = (cosine, sine, first) if k == -2 else (-sine, cosine, second)
            h = h_x, 0.0, h_y, 0.0
            x = measured.measurement[0, lane] - after[0]
            y = measured.measurement[1, lane] - after[2]
            innovation = h_x * x + h_y * y
        else:
            sensor, axis = sensors[k // 2], k % 2
            row = sensor.rate_row + axis
            if axis >= sensor.rates or math.isnan(measured.rates[row, lane]):
                continue
            rate = measured.rates[row, lane]
            h, innovation, variance = _rate_model(after, q, rate, sensor, axis, stands)
        after, q, (white, log_sigma, fits) = correct_scalar(after, q, h, innovation, variance)
        valid &= fits
        distance += white * white
        count += 1.0
        if k == -2:
            white_first = white
        elif k == -1:
            white_second = white
        if k < 0:
            log_variance += 0.5 * log_sigma
        else:
            log_rates += 0.5 * (LOG_TWO_PI + log_sigma)
    if not valid:
        return before[0], before[1], (0.0, 0.0, 2.0 * math.log(LARGEST)), -DIVERGED
    if not placed:
        log_variance = unseen[2][2]
    likelihood = -0.5 * distance
    if model.freedom > 0.0:
        likelihood = -0.5 * (model.freedom + count) * log(1.0 + distance / model.freedom)
        w = min((model.freedom + count) / (model.freedom + distance), 1.0)
        change = combination((1.0, -1.0), (after, moved[0]))
        after = combination((1.0, w), (moved[0], change))
    white_x = cosine * white_first - sine * white_second
    white_y = sine * white_first + cosine * white_second
    likelihood -= (LOG_TWO_PI + log_variance if placed else 0.0) + log_rates
    return after, q, (white_x, white_y, log_variance), likelihood
