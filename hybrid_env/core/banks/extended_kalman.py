"""The extended Kalman filter of a turn with uncertain centre and turn rate, as scalar functions.
The state is [x, vx, y, vy, centre_x, centre_y, turn_rate], with the suffixes x, u, y, v, cx, cy, r
below. The motion is that of Golubkov 2018, eq. (1). A covariance is its upper triangle row by row,
28 numbers.
"""

from hybrid_env.core.compilation import inlined
from hybrid_env.core.elementary import sine_cosine
from hybrid_env.core.memory import Triangle4

Vector7 = tuple[float, float, float, float, float, float, float]
# Covariance of the seven states, upper triangle row by row: 28 numbers.
Triangle7 = tuple[float, ...]


@inlined
def anchor_covariance(
    covariance: Triangle4,
    heading_x: float,
    heading_y: float,
    inverse_speed: float,
    radius: float,
) -> Triangle7:
    """Return J P J', the covariance of the seven states at the switch, from the covariance P of the
    anchor; J is their Jacobian by the anchor. heading: unit vector; inverse_speed: 1 / speed [s/m],
    bounded; radius: signed [m], 0 is straight, without centre and rate.
    """
    xx, xu, xy, xv, uu, uy, uv, yy, yv, vv = covariance
    turns = 0.0 if radius == 0.0 else 1.0
    # Derivatives of the centre (x - radius * heading_y, y + radius * heading_x) by the velocities.
    a = radius * heading_x * heading_y * inverse_speed
    b = -radius * heading_x * heading_x * inverse_speed
    c = radius * heading_y * heading_y * inverse_speed
    # Derivatives of the turn rate.
    p = 0.0 if radius == 0.0 else heading_x / abs(radius)
    q = 0.0 if radius == 0.0 else heading_y / abs(radius)
    # Rows of J P of the centre and the turn rate.
    x_x = turns * xx + a * xu + b * xv
    x_u = turns * xu + a * uu + b * uv
    x_y = turns * xy + a * uy + b * yv
    x_v = turns * xv + a * uv + b * vv
    y_x = turns * xy + c * xu - a * xv
    y_u = turns * uy + c * uu - a * uv
    y_y = turns * yy + c * uy - a * yv
    y_v = turns * yv + c * uv - a * vv
    r_x = p * xu + q * xv
    r_u = p * uu + q * uv
    r_y = p * uy + q * yv
    r_v = p * uv + q * vv
    return (
        xx,
        xu,
        xy,
        xv,
        x_x,
        y_x,
        r_x,
        uu,
        uy,
        uv,
        x_u,
        y_u,
        r_u,
        yy,
        yv,
        x_y,
        y_y,
        r_y,
        vv,
        x_v,
        y_v,
        r_v,
        turns * x_x + a * x_u + b * x_v,
        turns * x_y + c * x_u - a * x_v,
        p * x_u + q * x_v,
        turns * y_y + c * y_u - a * y_v,
        p * y_u + q * y_v,
        p * r_u + q * r_v,
    )


@inlined
def turn_coefficients(rate: float, tau: float) -> Vector7:
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
    p: Triangle7,
    turn: Vector7,
    by_rate: tuple[float, float, float, float],
    process_variance: float,
) -> Triangle7:
    """Return the predicted covariance F P F' + G Q G', where F is the Jacobian of the motion. turn:
    from `turn_coefficients`; by_rate: derivatives of x, vx, y and vy by the turn rate.
    """
    C, S, W, D, _, _, _ = turn
    g_x, h_x, g_y, h_y = by_rate
    (
        p0,
        p1,
        p2,
        p3,
        p4,
        p5,
        p6,
        p7,
        p8,
        p9,
        p10,
        p11,
        p12,
        p13,
        p14,
        p15,
        p16,
        p17,
        p18,
        p19,
        p20,
        p21,
        p22,
        p23,
        p24,
        p25,
        p26,
        p27,
    ) = p
    # Rows x, u, y, v of F P; columns x, u, y, v, cx, cy, r.
    x_x = C * p0 + S * p1 + D * p4 + g_x * p6
    u_x = C * p1 - W * p0 + W * p4 + h_x * p6
    x_u = C * p1 + S * p7 + D * p10 + g_x * p12
    u_u = C * p7 - W * p1 + W * p10 + h_x * p12
    x_y = C * p2 + S * p8 + D * p15 + g_x * p17
    u_y = C * p8 - W * p2 + W * p15 + h_x * p17
    x_v = C * p3 + S * p9 + D * p19 + g_x * p21
    u_v = C * p9 - W * p3 + W * p19 + h_x * p21
    x_cx = C * p4 + S * p10 + D * p22 + g_x * p24
    u_cx = C * p10 - W * p4 + W * p22 + h_x * p24
    x_cy = C * p5 + S * p11 + D * p23 + g_x * p26
    u_cy = C * p11 - W * p5 + W * p23 + h_x * p26
    x_r = C * p6 + S * p12 + D * p24 + g_x * p27
    u_r = C * p12 - W * p6 + W * p24 + h_x * p27
    y_y = C * p13 + S * p14 + D * p16 + g_y * p17
    v_y = C * p14 - W * p13 + W * p16 + h_y * p17
    y_v = C * p14 + S * p18 + D * p20 + g_y * p21
    v_v = C * p18 - W * p14 + W * p20 + h_y * p21
    y_cx = C * p15 + S * p19 + D * p23 + g_y * p24
    v_cx = C * p19 - W * p15 + W * p23 + h_y * p24
    y_cy = C * p16 + S * p20 + D * p25 + g_y * p26
    v_cy = C * p20 - W * p16 + W * p25 + h_y * p26
    y_r = C * p17 + S * p21 + D * p26 + g_y * p27
    v_r = C * p21 - W * p17 + W * p26 + h_y * p27
    return (
        C * x_x + S * x_u + D * x_cx + g_x * x_r,
        C * x_u - W * x_x + W * x_cx + h_x * x_r,
        C * x_y + S * x_v + D * x_cy + g_y * x_r,
        C * x_v - W * x_y + W * x_cy + h_y * x_r,
        x_cx,
        x_cy,
        x_r,
        C * u_u - W * u_x + W * u_cx + h_x * u_r + process_variance,
        C * u_y + S * u_v + D * u_cy + g_y * u_r,
        C * u_v - W * u_y + W * u_cy + h_y * u_r,
        u_cx,
        u_cy,
        u_r,
        C * y_y + S * y_v + D * y_cy + g_y * y_r,
        C * y_v - W * y_y + W * y_cy + h_y * y_r,
        y_cx,
        y_cy,
        y_r,
        C * v_v - W * v_y + W * v_cy + h_y * v_r + process_variance,
        v_cx,
        v_cy,
        v_r,
        p22,
        p23,
        p24,
        p25,
        p26,
        p27,
    )


@inlined
def condition(p: Triangle7, k: Vector7, inverse: float) -> Triangle7:
    """Return the corrected covariance P - K H P after the measurement of one coordinate. k:
    covariance of the states with the coordinate; inverse: 1 / innovation variance.
    """
    a = k[0] * inverse
    b = k[1] * inverse
    c = k[2] * inverse
    d = k[3] * inverse
    e = k[4] * inverse
    f = k[5] * inverse
    g = k[6] * inverse
    return (
        p[0] - a * k[0],
        p[1] - a * k[1],
        p[2] - a * k[2],
        p[3] - a * k[3],
        p[4] - a * k[4],
        p[5] - a * k[5],
        p[6] - a * k[6],
        p[7] - b * k[1],
        p[8] - b * k[2],
        p[9] - b * k[3],
        p[10] - b * k[4],
        p[11] - b * k[5],
        p[12] - b * k[6],
        p[13] - c * k[2],
        p[14] - c * k[3],
        p[15] - c * k[4],
        p[16] - c * k[5],
        p[17] - c * k[6],
        p[18] - d * k[3],
        p[19] - d * k[4],
        p[20] - d * k[5],
        p[21] - d * k[6],
        p[22] - e * k[4],
        p[23] - e * k[5],
        p[24] - e * k[6],
        p[25] - f * k[5],
        p[26] - f * k[6],
        p[27] - g * k[6],
    )
