"""The true object: its start, motion with process noise on the velocity, and measurements of its
position, and of its height where modes climb or descend. Golubkov 2018, eq. (1). Without a
measurement a tick has NaN; those of several sensors are fused.
"""

import math
from typing import Any

import numpy as np

from hybrid_env.core.arrays import AnyArray, FloatArray
from hybrid_env.core.compilation import apart, internal, stay_apart
from hybrid_env.core.elementary import exp
from hybrid_env.core.memory import SEGMENT_COLUMNS, arrays_of, state_of, write_lane
from hybrid_env.core.motion import (
    heading_vector,
    linear_motion,
    motion_coefficients,
    propagate,
    rows_of_matrix,
    turn_centre,
)
from hybrid_env.core.noise import LOST, draw_noise, draw_normals, uniform
from hybrid_env.core.polar import add_information, fused_position, measured_value, to_position
from hybrid_env.core.vectors import Vector, combination, product

SIGNED_RADIUS, MODE, LENGTH = range(len(SEGMENT_COLUMNS))


@internal
def draw_first_estimate(block: Any, noise: FloatArray, lane: int, setting: Any) -> None:
    """Set the initial state of the object of a lane and its process noise, and draw the first
    estimate, whose error has the normal distribution whose covariance the bank may use. noise: (7,
    LANES), overwritten.
    """
    deviation = setting.process_deviation
    if setting.process_range > 0.0:
        deviation *= exp(setting.process_range * uniform(block.random_state, lane))
    block.process_deviation[lane] = deviation
    heading = setting.heading
    if math.isnan(heading):
        heading = 2.0 * math.pi * uniform(block.random_state, lane)
    block.truth[0, lane], block.truth[2, lane] = 0.0, 0.0
    block.truth[1, lane] = setting.speed * math.cos(heading)
    block.truth[3, lane] = setting.speed * math.sin(heading)
    draw_normals(block.random_state, noise, lane, lane + np.uint64(1), None)
    block.clock[lane] = 0
    write_lane(block.noise, lane, (1.0, 0.0, 1.0))
    xx = setting.initial_position * setting.variance_x
    yy = setting.initial_position * setting.variance_y
    vv = setting.initial_velocity
    for k, variance in enumerate((xx, vv, yy, vv)):
        block.estimate[k, lane] = block.truth[k, lane] + math.sqrt(variance) * noise[k, lane]
    write_lane(block.covariance, lane, (xx, 0.0, 0.0, 0.0, vv, 0.0, 0.0, yy, 0.0, vv))
    # The first height is known.
    block.true_height[0, lane] = block.height_estimate[0, lane] = 0.0
    block.height_variances[0, lane] = 0.0


@internal
def begin_motion(
    block: Any, lane: int, segment: FloatArray, motions: AnyArray | None, tau: float
) -> None:
    """Begin a segment, a row of the segment table: centre and turn rate follow from the true
    state of the lane, and so does the acceleration of a mode of the user. motions: `MOTION` of
    every mode; None where all are straight motion and turns.
    """
    x, vx, y, vy = state_of(block.truth, lane)
    # 0 is straight.
    signed_radius = segment[SIGNED_RADIUS]
    speed, heading_x, heading_y = heading_vector(vx, vy)
    turn_rate = 0.0 if signed_radius == 0.0 else speed / abs(signed_radius)
    write_lane(block.true_motion, lane, motion_coefficients(turn_rate, tau))
    write_lane(block.true_centre, lane, turn_centre(x, y, heading_x, heading_y, signed_radius))
    if motions is not None:
        motion = motions[np.int64(segment[MODE])]
        acceleration = motion.acceleration
        block.true_height[1, lane] = motion.climb_rate
        block.true_acceleration[0, lane] = acceleration * heading_x
        block.true_acceleration[1, lane] = acceleration * heading_y


@internal
def _own_noise(
    block: Any, lane: int, noise: FloatArray, column: int, motion: Any, setting: Any
) -> Vector:
    """Return the process noise of a mode with a covariance of its own. Two normal numbers are those
    of all modes; four more are drawn into their column, and the measurement errors are kept.
    """
    u, v, error_x, error_y = noise[0, column], noise[1, column], noise[2, column], noise[3, column]
    first = np.uint64(column)
    draw_normals(block.random_state, noise, first, first + np.uint64(1), lane)
    normals = (u, v, noise[0, column], noise[1, column], noise[2, column], noise[3, column])
    noise[2, column], noise[3, column] = error_x, error_y
    return product(rows_of_matrix(motion.noise), normals)


@internal
def _move_linear(
    block: Any, lane: int, noise: FloatArray, column: int, motion: Any, setting: Any
) -> None:
    """Move the object of one lane by one tick of a linear mode of the user, and measure its
    position.
    """
    truth, acceleration = block.truth, block.true_acceleration
    before = (*state_of(truth, lane), acceleration[0, lane], acceleration[1, lane])
    if motion.own_noise:
        drawn = _own_noise(block, lane, noise, column, motion, setting)
    else:
        deviation = block.process_deviation[lane]
        drawn = (0.0, deviation * noise[0, column], 0.0, deviation * noise[1, column], 0.0, 0.0)
    after = combination((1.0, 1.0), (linear_motion(motion, before), drawn))
    write_lane(truth, lane, after[:4])
    write_lane(acceleration, lane, after[4:])
    block.measurement[0, lane] = after[0] + setting.deviation_x * noise[2, column]
    block.measurement[1, lane] = after[2] + setting.deviation_y * noise[3, column]
    block.tick[lane] += 1


@internal
def move_lane(
    block: Any, lane: int, noise: FloatArray, column: int, motions: AnyArray | None, setting: Any
) -> None:
    """Move the object of one lane by one tick and measure its position; column: that of the
    noise for this tick; motions: as in `begin_motion`.
    """
    if motions is not None:
        motion = motions[block.true_mode[lane]]
        if motion.signed_radius == 0.0:
            _move_linear(block, lane, noise, column, motion, setting)
            return
    truth = block.truth
    motion = block.true_motion
    centre = block.true_centre
    C = motion[0, lane]
    S = motion[1, lane]
    W = motion[2, lane]
    x, vx = propagate(truth[0, lane], truth[1, lane], centre[0, lane], C, S, W)
    y, vy = propagate(truth[2, lane], truth[3, lane], centre[1, lane], C, S, W)
    truth[0, lane] = x
    truth[1, lane] = vx + block.process_deviation[lane] * noise[0, column]
    truth[2, lane] = y
    truth[3, lane] = vy + block.process_deviation[lane] * noise[1, column]
    block.measurement[0, lane] = x + setting.deviation_x * noise[2, column]
    block.measurement[1, lane] = y + setting.deviation_y * noise[3, column]
    block.tick[lane] += 1


@apart
def _sense(
    block: Any,
    lane: int,
    noise: FloatArray,
    sensors: AnyArray,
    motions: AnyArray | None,
    setting: Any,
) -> None:
    """Move the object of one lane by one tick, and fuse the measurements of all sensors that have
    one: their mean weighted by the inverse covariances, whose sum is its inverse covariance. Every
    sensor draws random numbers in every tick, so that the stream does not depend on where the
    object is.
    """
    stay_apart()
    clock, truth, first, last = block.clock[lane], block.truth, lane, lane + np.uint64(1)
    # Over that of one sensor of variance R.
    information = (0.0, 0.0, 0.0, 0.0, 0.0)
    for k in range(sensors.size):
        sensor = sensors[k]
        draw_noise(block.random_state, noise, first, last, setting)
        # The first draw also moves the object.
        if k == 0:
            move_lane(block, lane, noise, lane, motions, setting)
        x, y = truth[0, lane] - sensor.x, truth[2, lane] - sensor.y
        distance = math.hypot(x, y)
        measures = clock % sensor.period == 0 and distance <= sensor.range
        measures = measures and not (setting.missed > 0.0 and noise[LOST, lane] < setting.missed)
        noise_x = noise[2, lane]
        noise_y = noise[3, lane]
        if sensor.rates > 0:
            draw_noise(block.random_state, noise, first, last, setting)
            u, v = truth[1, lane], truth[3, lane]
            if motions is not None and motions[block.true_mode[lane]].stands:
                u, v = 0.0, 0.0
            for k in range(sensor.rates):
                value = measured_value(sensor.kinds[k], x, y, u, v)
                value += sensor.deviations[k] * noise[2 + k, lane]
                block.rates[sensor.rate_row + k, lane] = value if measures else np.nan
        if not (measures and sensor.places):
            continue
        if sensor.bearing_deviation > 0.0:
            along_x, along_y = (x / distance, y / distance) if distance > 0.0 else (1.0, 0.0)
            turned = sensor.bearing_deviation * noise_y
            sine = math.sin(turned)
            cosine = math.cos(turned)
            position = to_position(
                distance + sensor.deviation * noise_x,
                cosine * along_x - sine * along_y,
                sine * along_x + cosine * along_y,
                sensor.deviation,
                sensor.bearing_deviation,
            )
            # 1 / R.
            inverse = 1.0 / (sensor.precision * sensor.deviation * sensor.deviation)
            information = add_information(
                information,
                position[0] - x,
                position[1] - y,
                (inverse * position[2], inverse * position[3], inverse * position[4]),
            )
        else:
            weight = sensor.precision * sensor.deviation
            information = (
                information[0] + sensor.precision,
                information[1],
                information[2] + sensor.precision,
                information[3] + weight * noise_x,
                information[4] + weight * noise_y,
            )
    block.clock[lane] = clock + 1
    if information[0] > 0.0:
        error_x, error_y, xx, xy, yy = fused_position(information)
        block.measurement[0, lane] = truth[0, lane] + error_x
        block.measurement[1, lane] = truth[2, lane] + error_y
        write_lane(block.noise, lane, (xx, xy, yy))
    else:
        block.measurement[0, lane] = block.measurement[1, lane] = np.nan


@apart
def _climb(block: Any, first: int, last: int, setting: Any) -> None:
    """Move the heights of lanes first .. last - 1 by one tick, and measure those of objects whose
    position is measured. The rate changes by process noise alone.
    """
    stay_apart()
    # An array that a caller gives would be counted at every tick.
    noise = arrays_of(setting).scratch[0].noise
    draw_normals(block.random_state, noise, first, last, None)
    for lane in range(first, last):
        rate = block.true_height[1, lane]
        height = block.true_height[0, lane] + setting.tau * rate
        rate += math.sqrt(setting.climb_variance) * noise[0, lane]
        write_lane(block.true_height, lane, (height, rate))
        error = math.sqrt(setting.height_variance) * noise[1, lane]
        block.height[lane] = np.nan if math.isnan(block.measurement[0, lane]) else height + error


@internal
def move(
    block: Any,
    noise: FloatArray,
    first: int,
    last: int,
    sensors: AnyArray,
    motions: AnyArray | None,
    setting: Any,
) -> None:
    """Move the objects of lanes first .. last - 1 by one tick and measure their positions, without
    sensors with variance R everywhere. noise: (7, LANES), overwritten; motions: as in
    `begin_motion`.
    """
    if sensors.size > 0:
        for lane in range(first, last):
            _sense(block, lane, noise, sensors, motions, setting)
        return
    draw_noise(block.random_state, noise, first, last, setting)
    for lane in range(first, last):
        move_lane(block, lane, noise, lane, motions, setting)
    if setting.missed > 0.0:
        for lane in range(first, last):
            if noise[LOST, lane] < setting.missed:
                block.measurement[0, lane] = block.measurement[1, lane] = np.nan
    if motions is not None and setting.height_rows > 0:
        _climb(block, first, last, setting)
