"""Motion of the object: straight lines and turns about a fixed centre, one axis at a time.

Golubkov 2018, eq. (1). A turn that begins in the state (p_s, v_s) at the switch has the turn rate
omega = |v_s| / r and the centre c = p_s + n r (left) or p_s - n r (right), where n is the left
normal of v_s / |v_s|. The centre and the turn rate are constant over the segment. Each axis is
therefore a linear oscillator about the coordinate of the centre, and straight motion is the limit
omega = 0.
"""

import math
from typing import Any

from hybrid_env.core.arrays import FloatArray
from hybrid_env.core.compilation import internal
from hybrid_env.core.vectors import Vector, product

# [rad], turned per tick in the model of a bank.
LARGEST_ANGLE = 1000.0


@internal
def motion_coefficients(turn_rate: float, tau: float) -> tuple[float, float, float]:
    """Return cos(omega tau), sin(omega tau) / omega [s] and omega sin(omega tau) [1/s]: the entries
    of the transition matrix Phi of one axis over one tick. Golubkov 2018, eq. (1); omega >= 0
    [rad/s], 0 is straight motion.
    """
    # sin(x) / x = 1 here; the quotient below could underflow to 0/0.
    if turn_rate < 1e-150:
        return 1.0, tau, 0.0
    sine = math.sin(turn_rate * tau)
    return math.cos(turn_rate * tau), sine / turn_rate, turn_rate * sine


@internal
def propagate(
    position: float,
    velocity: float,
    centre: float,
    cosine: float,
    sine_velocity: float,
    sine_position: float,
) -> tuple[float, float]:
    """Return position [m] and velocity [m/s] of one axis after a tick without noise. Golubkov 2018,
    eq. (1). centre: of the turn [m]; any finite number for straight motion.
    """
    offset = position - centre
    return (
        centre + cosine * offset + sine_velocity * velocity,
        cosine * velocity - sine_position * offset,
    )


@internal
def bank_turn_rate(speed: float, radius: float, tau: float) -> float:
    """Return the turn rate that a bank assumes, speed / radius, at most `LARGEST_ANGLE` per tick
    [rad/s]. Unbounded, the estimated speed could grow in every wrongly decided segment until it
    overflows.
    """
    return min(speed / radius, LARGEST_ANGLE / tau)


@internal
def heading_vector(velocity_x: float, velocity_y: float) -> tuple[float, float, float]:
    """Return the speed [m/s] and the unit vector of the heading, which is (1, 0) for an object
    at rest.
    """
    speed = math.hypot(velocity_x, velocity_y)
    if speed > 0.0:
        return speed, velocity_x / speed, velocity_y / speed
    return 0.0, 1.0, 0.0


@internal
def turn_centre(
    x: float, y: float, heading_x: float, heading_y: float, signed_radius: float
) -> tuple[float, float]:
    """Return the centre [m] of a turn that starts at (x, y) with a unit heading; radius positive
    to the left [m].
    """
    return x - heading_y * signed_radius, y + heading_x * signed_radius


@internal
def six_of(array: FloatArray) -> Vector:
    """Return the values of an array, (6,), as a vector."""
    return array[0], array[1], array[2], array[3], array[4], array[5]


@internal
def rows_of_matrix(matrix: FloatArray) -> tuple[Vector, ...]:
    """Return the rows of a matrix, (6, 6), as vectors."""
    return (
        six_of(matrix[0]),
        six_of(matrix[1]),
        six_of(matrix[2]),
        six_of(matrix[3]),
        six_of(matrix[4]),
        six_of(matrix[5]),
    )


@internal
def linear_motion(motion: Any, state: Vector) -> Vector:
    """Return F x + B of a linear mode, a record `MOTION`; x = [x, vx, y, vy, ax, ay]."""
    x, u, y, v, a, b = product(rows_of_matrix(motion.F), state)
    B = six_of(motion.B)
    return x + B[0], u + B[1], y + B[2], v + B[3], a + B[4], b + B[5]
