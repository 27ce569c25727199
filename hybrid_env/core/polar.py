"""What a sensor measures of an object: range, bearing and range rate of a radar, velocities, and
the conversion of range and bearing to a position.

The converted position is the mean of the true one given the measurement, with its covariance: Duan,
Han & Li 2004, "Comments on 'Unbiased converted measurements for tracking'". It is exp(-s^2 / 2)
times the measured direction, s the standard deviation of the bearing. The conversion that divides
by this factor instead (Longbin et al. 1998) has in the filter an error along the line of sight of
range * s^2.
"""

import math

from hybrid_env.core.compilation import inlined, internal

# x, y and their covariance xx, xy, yy.
Position = tuple[float, float, float, float, float]
Information = tuple[float, float, float, float, float]
"""Inverse covariance xx, xy, yy, and its product with the error x, y."""


RANGE_RATE, VELOCITY_X, VELOCITY_Y, RANGE, BEARING = range(5)


@internal
def measured_value(kind: int, x: float, y: float, u: float, v: float) -> float:
    """Return what a sensor measures of a position relative to it [m] with a velocity [m/s]."""
    if kind == RANGE_RATE:
        return range_rate(x, y, u, v)
    if kind == RANGE:
        return math.hypot(x, y)
    if kind == BEARING:
        return math.atan2(y, x)
    return u if kind == VELOCITY_X else v


@internal
def range_rate(x: float, y: float, u: float, v: float) -> float:
    """Return the range rate of a position relative to the radar [m] with a velocity [m/s]."""
    return (x * u + y * v) / max(math.hypot(x, y), 1e-300)


@internal
def to_position(
    distance: float,
    along_x: float,
    along_y: float,
    range_deviation: float,
    bearing_deviation: float,
) -> Position:
    """Return the position relative to the radar of a measured range [m] and direction, and its
    covariance. along: unit vector of the measured bearing; the standard deviations are in m and
    rad.
    """
    square = bearing_deviation * bearing_deviation
    shorter = -math.expm1(-square)
    turn = -0.5 * math.expm1(-2.0 * square)
    along = distance * distance * (shorter - turn) + range_deviation * range_deviation * (
        1.0 - turn
    )
    across = turn * (distance * distance + range_deviation * range_deviation)
    # One variance is at least 1e-10 times the other.
    along, across = max(along, 1e-10 * across), max(across, 1e-10 * along)
    distance *= math.exp(-0.5 * square)
    return (
        distance * along_x,
        distance * along_y,
        along * along_x * along_x + across * along_y * along_y,
        (along - across) * along_x * along_y,
        along * along_y * along_y + across * along_x * along_x,
    )


@inlined
def position_noise(
    x: float, y: float, range_deviation: float, bearing_deviation: float
) -> tuple[float, float, float]:
    """Return the covariance xx, xy, yy of a position (x, y) relative to the radar from
    `to_position`.
    """
    length = max(math.hypot(x, y), 1e-300)
    distance = length * math.exp(0.5 * bearing_deviation * bearing_deviation)
    position = to_position(distance, x / length, y / length, range_deviation, bearing_deviation)
    return position[2], position[3], position[4]


@inlined
def add_information(
    information: Information, error_x: float, error_y: float, covariance: tuple[float, float, float]
) -> Information:
    """Return the information with that of an independent position. covariance: xx, xy, yy."""
    xx, xy, yy = covariance
    inverse = 1.0 / (xx * yy - xy * xy)
    a = yy * inverse
    b = -xy * inverse
    c = xx * inverse
    return (
        information[0] + a,
        information[1] + b,
        information[2] + c,
        information[3] + a * error_x + b * error_y,
        information[4] + b * error_x + c * error_y,
    )


@inlined
def fused_position(information: Information) -> Position:
    """Return the error of the fused position and its covariance."""
    a, b, c, x, y = information
    # Position sensors only.
    if b == 0.0 and a == c:
        return x / a, y / a, 1.0 / a, 0.0, 1.0 / a
    inverse = 1.0 / (a * c - b * b)
    xx = c * inverse
    xy = -b * inverse
    yy = a * inverse
    return xx * x + xy * y, xy * x + yy * y, xx, xy, yy
