"""The extended Kalman filter of a turn with uncertain centre and turn rate, as scalar functions.
The state is [x, vx, y, vy, centre_x, centre_y, turn_rate], with the suffixes x, u, y, v, cx, cy, r
below. The motion is that of Golubkov 2018, eq. (1). A covariance is its upper triangle row by row,
28 numbers.
"""

from typing import Any

from hybrid_env.core.compilation import inlined
from hybrid_env.core.elementary import sine_cosine
from hybrid_env.core.memory import Triangle4
from hybrid_env.core.vectors import Vector, combination, rows_of, transposed, widened


@inlined
def anchor_covariance(
    covariance: Triangle4, heading_x: float, heading_y: float, inverse_speed: float, radius: float
) -> Vector:
    """Return J P J', the covariance of the seven states at the switch, from the covariance P of the
    anchor; J is their Jacobian by the anchor. heading: unit vector; inverse_speed: 1 / speed [s/m],
    bounded; radius: signed [m], 0 is straight, without centre and rate.
    """
    x, u, y, v = rows_of(covariance)
    turns = 0.0 if radius == 0.0 else 1.0
    # Derivatives of the centre (x - radius * heading_y, y + radius * heading_x) by the velocities.
    a = radius * heading_x * heading_y * inverse_speed
    b = -radius * heading_x * heading_x * inverse_speed
    c = radius * heading_y * heading_y * inverse_speed
    # Derivatives of the turn rate.
    p = 0.0 if radius == 0.0 else heading_x / abs(radius)
    q = 0.0 if radius == 0.0 else heading_y / abs(radius)
    # Rows of J P of the centre and the turn rate, and its columns.
    centre_x = combination((turns, a, b), (x, u, v))
    centre_y = combination((turns, c, -a), (y, u, v))
    rate = combination((p, q), (u, v))
    by_x, by_u, by_y, by_v = transposed((centre_x, centre_y, rate))
    # Columns of J P J' of the centre and the turn rate.
    xx, _, _ = combination((turns, a, b), (by_x, by_u, by_v))
    xy, yy, _ = combination((turns, c, -a), (by_y, by_u, by_v))
    xr, yr, rr = combination((p, q), (by_u, by_v))
    return x + by_x + u[1:] + by_u + y[2:] + by_y + v[3:] + by_v + (xx, xy, xr, yy, yr, rr)


@inlined
def turn_coefficients(rate: float, tau: float) -> Vector:
    """Return (C, S, W, D, dC, dS, dW) of a tick at a turn rate [rad/s]. C = cos a, S = sin a /
    rate, W = rate sin a and D = 1 - cos a for a = rate * tau; dC, dS and dW are the derivatives of
    C, S and W by the rate.
    """
    angle = rate * tau
    sine, C = sine_cosine(angle)
    square = angle * angle
    product = angle * sine
    # [rad]; then quotients of small numbers are computed by series.
    small = abs(angle) < 0.02
    safe = 1.0 if small else angle
    # sin(a) / a and its derivative.
    quotient = (
        1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0)) if small else sine / safe
    )
    derivative = (
        -angle / 3.0 * (1.0 - square / 10.0 * (1.0 - square / 28.0))
        if small
        else (C - sine / safe) / safe
    )
    S = tau * quotient
    W = product / tau
    # Avoids the cancellation of 1 - cos.
    D = product * quotient / (1.0 + C) if C > 0.0 else 1.0 - C
    return C, S, W, D, -tau * rate * S, tau * tau * derivative, rate * S + rate * tau * C


@inlined
def predict_covariance(
    p: Vector, turn: Vector, by_rate: tuple[float, float, float, float], model: Any
) -> Vector:
    """Return the predicted covariance F P F' + Q of a `FilterModel`, where F is the Jacobian of the
    motion. turn: from `turn_coefficients`; by_rate: derivatives of x, vx, y and vy by the turn
    rate. A drift of the measured positions moves the object and its centre by the same way.
    """
    C, S, W, D, _, _, _ = turn
    g_x, h_x, g_y, h_y = by_rate
    p = widened(p)
    p_x, p_u, p_y, p_v, p_cx, p_cy, p_r = rows_of(p)
    # Rows of F P, and its columns.
    x = combination((C, S, D, g_x), (p_x, p_u, p_cx, p_r))
    u = combination((C, -W, W, h_x), (p_u, p_x, p_cx, p_r))
    y = combination((C, S, D, g_y), (p_y, p_v, p_cy, p_r))
    v = combination((C, -W, W, h_y), (p_v, p_y, p_cy, p_r))
    by_x, by_u, by_y, by_v, by_cx, by_cy, by_r = transposed((x, u, y, v))
    # Columns of F P F'.
    xx, _, _, _ = combination((C, S, D, g_x), (by_x, by_u, by_cx, by_r))
    xu, uu, _, _ = combination((C, -W, W, h_x), (by_u, by_x, by_cx, by_r))
    xy, uy, yy, _ = combination((C, S, D, g_y), (by_y, by_v, by_cy, by_r))
    xv, uv, yv, vv = combination((C, -W, W, h_y), (by_v, by_y, by_cy, by_r))
    Q, drift = model.process_variance, model.drift_variance
    rows_x = (xx + drift, xu, xy, xv, x[4] + drift, *x[5:])
    rows_y = (yy + drift, yv, y[4], y[5] + drift, y[6])
    centres = (p_cx[4] + drift, *p_cx[5:], p_cy[5] + drift, p_cy[6], p_r[6])
    return (*rows_x, uu + Q, uy, uv, *u[4:], *rows_y, vv + Q, *v[4:], *centres)
