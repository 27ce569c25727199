"""The Kalman filter of a linear mode x' = F x + B + w of the user, as scalar functions. The states
[x, vx, y, vy, ax, ay] are the first six of a filter of seven.
"""

from typing import Any

from hybrid_env.core.banks.bank import covariance7, state_of
from hybrid_env.core.compilation import formula
from hybrid_env.core.memory import FloatArray, Triangle4
from hybrid_env.core.motion import linear_motion, rows_of_matrix
from hybrid_env.core.vectors import Vector, combination, rows_of, sandwich, transposed, widened

# Upper triangle row by row.
Triangle6 = Vector


@formula
def triangle6(matrix: FloatArray) -> Triangle6:
    """Return the upper triangle of a matrix, (6, 6), row by row."""
    a, b, c, d, e, f = rows_of_matrix(matrix)
    return a + b[1:] + c[2:] + d[3:] + e[4:] + f[5:]


@formula
def predict_covariance(p: Triangle6, motion: Any) -> Triangle6:
    """Return F P F' + Q of a linear mode, a record `MOTION`."""
    moved = sandwich(rows_of_matrix(motion.F), widened(p))
    return combination((1.0, 1.0), (moved, triangle6(motion.Q)))


@formula
def acceleration_covariance(
    covariance: Triangle4, heading_x: float, heading_y: float, slope: float
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


@formula
def predict_linear(kalman: Any, lane: int, motion: Any) -> tuple[Vector, Vector]:
    """Return the predicted state of the filter of a linear mode and its covariance."""
    state = linear_motion(motion, state_of(kalman, lane)[:6])
    predicted = predict_covariance(_of_seven(covariance7(kalman, lane)), motion)
    return (*state, 0.0), in_seven(predicted)
