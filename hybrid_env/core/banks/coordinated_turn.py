"""The Kalman filter of a coordinated turn, as scalar functions.

The state is [x, vx, y, vy], with the suffixes x, u, y and v below. In every tick the object turns by the
angle a = speed * tau / radius about the centre that follows from its velocity: Golubkov 2018, eq. (1), with
the switch at the present tick. The filter therefore runs on over switches and needs no anchor. The angle
follows from the estimated velocity and is then treated as known, because the turn rate of the object does not
change with the process noise of a segment. A covariance is its upper triangle row by row, 10 numbers.
"""

import math

from hybrid_env.core.banks.bank import State, Triangle4
from hybrid_env.core.compilation import inlined
from hybrid_env.core.elementary import sine_cosine
from hybrid_env.core.motion import LARGEST_ANGLE


@inlined
def turn_angle(u: float, v: float, curvature: float, tau: float) -> float:
    """Return the angle of a turn in one tick [rad], positive to the left, bounded; curvature: 1 / radius [1/m]."""
    angle = curvature * math.sqrt(u * u + v * v) * tau
    return max(min(angle, LARGEST_ANGLE), -LARGEST_ANGLE)


@inlined
def turn_coefficients(angle: float, tau: float) -> State:
    """Return (C, S, along, across) of a turn by an angle a in a tick of length tau.

    The new velocity is (C u - S v, S u + C v), with C = cos a and S = sin a; the position changes by
    (along u - across v, across u + along v), with along = tau sin(a) / a, across = tau (1 - cos a) / a [s].
    """
    half = 0.5 * angle
    sine, cosine = sine_cosine(half)
    quotient = sine / half if half != 0.0 else 1.0
    # half angles avoid the cancellation of 1 - cos a
    return (
        1.0 - 2.0 * sine * sine, 2.0 * sine * cosine, tau * quotient * cosine, tau * quotient * sine,
    )  # fmt: skip


@inlined
def predict_covariance(p: Triangle4, turn: State, process_variance: float) -> Triangle4:
    """Return the predicted covariance F P F' + G Q G', F the transition matrix; turn: from `turn_coefficients`."""
    xx, xu, xy, xv, uu, uy, uv, yy, yv, vv = p
    C, S, along, across = turn
    # covariance of the new position with the old velocity
    x_u, x_v = xu + along * uu - across * uv, xv + along * uv - across * vv
    y_u, y_v = uy + across * uu + along * uv, yv + across * uv + along * vv
    # covariance of the new velocity with the old one
    u_u, u_v, v_u, v_v = C * uu - S * uv, C * uv - S * vv, S * uu + C * uv, S * uv + C * vv
    return (
        xx + along * (x_u + xu) - across * (x_v + xv),
        C * x_u - S * x_v,
        xy + across * x_u + along * x_v + along * uy - across * yv,
        S * x_u + C * x_v,
        C * u_u - S * u_v + process_variance,
        C * y_u - S * y_v,
        S * u_u + C * u_v,
        yy + across * (y_u + uy) + along * (y_v + yv),
        S * y_u + C * y_v,
        S * v_u + C * v_v + process_variance,
    )  # fmt: skip


@inlined
def condition_x(p: Triangle4, inverse: float, variance: float) -> Triangle4:
    """Return the corrected covariance P - K H P after a measurement of x with variance R.

    inverse: 1 / innovation variance [1/m^2].
    """
    xx, xu, xy, xv, uu, uy, uv, yy, yv, vv = p
    left = variance * inverse  # the row of the measured coordinate is K R, which avoids cancellation
    gain_u, gain_y, gain_v = xu * inverse, xy * inverse, xv * inverse
    # variances are bounded below, so that rounding does not make them negative
    return (
        xx * left, xu * left, xy * left, xv * left,
        max(uu - gain_u * xu, gain_u * gain_u * variance), uy - gain_u * xy, uv - gain_u * xv,
        max(yy - gain_y * xy, gain_y * gain_y * variance), yv - gain_y * xv,
        max(vv - gain_v * xv, gain_v * gain_v * variance),
    )  # fmt: skip


@inlined
def exchange_axes(p: Triangle4) -> Triangle4:
    """Return the covariance of [y, vy, x, vx]."""
    xx, xu, xy, xv, uu, uy, uv, yy, yv, vv = p
    return yy, yv, xy, uy, vv, xv, uv, xx, xu, uu
