"""The anchor-aware bank: the uncertainty of the anchor is in the likelihood of every turn.

The published bank computes centre and turn rate from the estimate at the switch and takes them as exact.
Here they are part of the state: each hypothesis is an extended Kalman filter of
[x, vx, y, vy, centre_x, centre_y, turn_rate] for the motion of Golubkov 2018, eq. (1), and starts with the
covariance J P J', where P is that of the estimate at the switch and J the derivative of the seven by the
four. The straight line is the turn of rate 0, whose centre and rate have no variance.

A filter that diverges keeps its state and loses likelihood, so that it yields no NaN.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid_env.core.compilation import formula, internal
from hybrid_env.core.elementary import log, sine_cosine
from hybrid_env.core.in_place import in_place, prefetch
from hybrid_env.core.instructions import span
from hybrid_env.core.memory import aligned_zeros
from hybrid_env.core.motion import heading_vector, turn_centre
from hybrid_env.core.published_bank import INNOVATION, LOG_TWO_PI, Quadruple
from hybrid_env.core.records import lanes_of

AWARE = lanes_of(
    *((name, np.float64, ()) for name in ("x", "vx", "y", "vy")),  # estimate [m, m/s]
    *((name, np.float64, ()) for name in ("centre_x", "centre_y")),  # of the turn [m]
    ("turn_rate", np.float64, ()),  # [rad/s]
    ("covariance", np.float64, (28,)),  # upper triangle of the seven, row by row
    ("log_likelihood", np.float64, ()),  # cumulative since the switch
)
"""One filter of the bank."""

DIVERGED = 1e3  # loss of log-likelihood at a tick at which a filter has diverged
LARGEST = 1e12  # m or m/s: a filter beyond it has diverged
ROUNDING = 1e-6  # of a variance, below zero
SERIES = 0.02  # below this angle a quotient of small numbers is taken from its series

Ten = tuple[float, float, float, float, float, float, float, float, float, float]
Seven = tuple[float, float, float, float, float, float, float]


class AwareBank(NamedTuple):
    """The bank of a block of tracks.

    Attributes:
        hypotheses: (M,) records `AWARE`.
        innovations: (M,) records `bank.INNOVATION` of the last tick, which other blocks overwrite.
    """

    hypotheses: NDArray[Any]
    innovations: NDArray[Any]


def aware_arrays(radii_count: int, *blocks: int) -> AwareBank:
    """A bank of zeros; with a number of blocks, what each block has of its own has that axis in front."""
    hypotheses = 2 * radii_count + 1
    return AwareBank(aligned_zeros((*blocks, hypotheses), AWARE), aligned_zeros((hypotheses,), INNOVATION))


@internal
def anchor_aware(
    bank: AwareBank, lane: int, anchor: Quadruple, radii: NDArray[np.float64], covariance: Ten
) -> None:
    """Start every hypothesis of a lane at one estimate.

    Args:
        anchor: estimate [x, vx, y, vy] at the switch [m, m/s].
        radii: (n,) turn radii of the bank [m].
        covariance: of the anchor, upper triangle row by row.
    """
    n = radii.size
    xx, xu, xy, xv, uu, uy, uv, yy, yv, vv = covariance  # u, v: the velocities along x and y
    speed, along_x, along_y = heading_vector(anchor[1], anchor[3])
    # an object slower than its uncertainty has no heading to linearise at: at most about a radian
    slow = 1.0 / max(speed, math.sqrt(uu + vv), 1e-12)
    for h in span(0, 2 * n + 1):
        kalman = in_place(bank.hypotheses[h])
        radius = 0.0
        if h > n:
            radius = -radii[h - n - 1]
        elif h > 0:
            radius = radii[h - 1]
        kalman.x[lane], kalman.vx[lane], kalman.y[lane], kalman.vy[lane] = anchor
        kalman.log_likelihood[lane] = 0.0
        kalman.centre_x[lane], kalman.centre_y[lane] = turn_centre(
            anchor[0], anchor[2], along_x, along_y, radius
        )
        kalman.turn_rate[lane] = 0.0 if h == 0 else speed / abs(radius)
        turns = 0.0 if h == 0 else 1.0
        # centre = (x - radius * along_y, y + radius * along_x): its derivatives by the velocities
        a = radius * along_x * along_y * slow
        b = -radius * along_x * along_x * slow
        c = radius * along_y * along_y * slow
        p = 0.0 if h == 0 else along_x / abs(radius)  # turn rate by the velocities
        q = 0.0 if h == 0 else along_y / abs(radius)
        # rows of J P for centre and rate
        x_x, x_u, x_y, x_v = (
            turns * xx + a * xu + b * xv, turns * xu + a * uu + b * uv,
            turns * xy + a * uy + b * yv, turns * xv + a * uv + b * vv,
        )  # fmt: skip
        y_x, y_u, y_y, y_v = (
            turns * xy + c * xu - a * xv, turns * uy + c * uu - a * uv,
            turns * yy + c * uy - a * yv, turns * yv + c * uv - a * vv,
        )  # fmt: skip
        r_x, r_u, r_y, r_v = p * xu + q * xv, p * uu + q * uv, p * uy + q * yv, p * uv + q * vv
        for k, value in enumerate(
            (
                xx, xu, xy, xv, x_x, y_x, r_x,
                uu, uy, uv, x_u, y_u, r_u,
                yy, yv, x_y, y_y, r_y,
                vv, x_v, y_v, r_v,
                turns * x_x + a * x_u + b * x_v, turns * x_y + c * x_u - a * x_v, p * x_u + q * x_v,
                turns * y_y + c * y_u - a * y_v, p * y_u + q * y_v,
                p * r_u + q * r_v,
            )
        ):  # fmt: skip
            kalman.covariance[k, lane] = value


@formula
def turn_derivatives(angle: float) -> tuple[float, float, float, float]:
    """Cosine, sin(a)/a, a sin(a) and the derivative of sin(a)/a by a, for a = turn rate times tau."""
    sine, cosine = sine_cosine(angle)
    square = angle * angle
    small = abs(angle) < SERIES
    safe = 1.0 if small else angle
    quotient = 1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0)) if small else sine / safe
    derivative = (
        -angle / 3.0 * (1.0 - square / 10.0 * (1.0 - square / 28.0))
        if small
        else (cosine - sine / safe) / safe
    )
    return cosine, quotient, angle * sine, derivative


@formula
def condition(p: Any, k: Seven, inverse: float) -> Any:
    """The 28 covariances after one measured number: k, covariance of the seven with it."""
    a, b, c, d, e, f, g = (
        k[0] * inverse, k[1] * inverse, k[2] * inverse, k[3] * inverse,
        k[4] * inverse, k[5] * inverse, k[6] * inverse,
    )  # fmt: skip
    return (
        p[0] - a * k[0], p[1] - a * k[1], p[2] - a * k[2], p[3] - a * k[3],
        p[4] - a * k[4], p[5] - a * k[5], p[6] - a * k[6],
        p[7] - b * k[1], p[8] - b * k[2], p[9] - b * k[3], p[10] - b * k[4],
        p[11] - b * k[5], p[12] - b * k[6],
        p[13] - c * k[2], p[14] - c * k[3], p[15] - c * k[4], p[16] - c * k[5], p[17] - c * k[6],
        p[18] - d * k[3], p[19] - d * k[4], p[20] - d * k[5], p[21] - d * k[6],
        p[22] - e * k[4], p[23] - e * k[5], p[24] - e * k[6],
        p[25] - f * k[5], p[26] - f * k[6],
        p[27] - g * k[6],
    )  # fmt: skip


@internal
def step_hypothesis(
    kalman: Any,
    innovation: Any,
    first: int,
    last: int,
    measurement: NDArray[np.float64],
    tau: float,
    process_variance: float,
    variance_x: float,
    variance_y: float,
) -> None:
    """Predict, compare with the measurement, correct, add to the log-likelihood: one hypothesis, one tick."""
    P = kalman.covariance
    for lane in span(first, last):
        x, u, y, v = kalman.x[lane], kalman.vx[lane], kalman.y[lane], kalman.vy[lane]
        centre_x, centre_y, rate = kalman.centre_x[lane], kalman.centre_y[lane], kalman.turn_rate[lane]
        C, quotient, product, derivative = turn_derivatives(rate * tau)
        S, W = tau * quotient, product / tau  # sin / rate, rate * sin
        D = product * quotient / (1.0 + C) if C > 0.0 else 1.0 - C  # 1 - cos, without its cancellation
        from_x, from_y = x - centre_x, y - centre_y
        # derivatives of position and velocity by the turn rate
        dS = tau * tau * derivative
        dC = -tau * rate * S
        dW = rate * S + rate * tau * C
        g_x, h_x = dC * from_x + dS * u, dC * u - dW * from_x
        g_y, h_y = dC * from_y + dS * v, dC * v - dW * from_y

        # T = F P for the rows of x, u, y, v; columns x, u, y, v, centre_x, centre_y, rate
        p0, p1, p2, p3, p4, p5, p6 = (
            P[0, lane], P[1, lane], P[2, lane], P[3, lane], P[4, lane], P[5, lane], P[6, lane],
        )  # fmt: skip
        p7, p8, p9, p10, p11, p12 = (
            P[7, lane], P[8, lane], P[9, lane], P[10, lane], P[11, lane], P[12, lane],
        )  # fmt: skip
        p13, p14, p15, p16, p17 = P[13, lane], P[14, lane], P[15, lane], P[16, lane], P[17, lane]
        p18, p19, p20, p21 = P[18, lane], P[19, lane], P[20, lane], P[21, lane]
        p22, p23, p24 = P[22, lane], P[23, lane], P[24, lane]
        p25, p26, p27 = P[25, lane], P[26, lane], P[27, lane]
        x_x, u_x = C * p0 + S * p1 + D * p4 + g_x * p6, C * p1 - W * p0 + W * p4 + h_x * p6
        x_u, u_u = C * p1 + S * p7 + D * p10 + g_x * p12, C * p7 - W * p1 + W * p10 + h_x * p12
        x_y, u_y = C * p2 + S * p8 + D * p15 + g_x * p17, C * p8 - W * p2 + W * p15 + h_x * p17
        x_v, u_v = C * p3 + S * p9 + D * p19 + g_x * p21, C * p9 - W * p3 + W * p19 + h_x * p21
        x_cx, u_cx = C * p4 + S * p10 + D * p22 + g_x * p24, C * p10 - W * p4 + W * p22 + h_x * p24
        x_cy, u_cy = C * p5 + S * p11 + D * p23 + g_x * p26, C * p11 - W * p5 + W * p23 + h_x * p26
        x_r, u_r = C * p6 + S * p12 + D * p24 + g_x * p27, C * p12 - W * p6 + W * p24 + h_x * p27
        y_y, v_y = C * p13 + S * p14 + D * p16 + g_y * p17, C * p14 - W * p13 + W * p16 + h_y * p17
        y_v, v_v = C * p14 + S * p18 + D * p20 + g_y * p21, C * p18 - W * p14 + W * p20 + h_y * p21
        y_cx, v_cx = C * p15 + S * p19 + D * p23 + g_y * p24, C * p19 - W * p15 + W * p23 + h_y * p24
        y_cy, v_cy = C * p16 + S * p20 + D * p25 + g_y * p26, C * p20 - W * p16 + W * p25 + h_y * p26
        y_r, v_r = C * p17 + S * p21 + D * p26 + g_y * p27, C * p21 - W * p17 + W * p26 + h_y * p27
        # T F', and the process noise on the velocities
        predicted = (
            C * x_x + S * x_u + D * x_cx + g_x * x_r,
            C * x_u - W * x_x + W * x_cx + h_x * x_r,
            C * x_y + S * x_v + D * x_cy + g_y * x_r,
            C * x_v - W * x_y + W * x_cy + h_y * x_r,
            x_cx, x_cy, x_r,
            C * u_u - W * u_x + W * u_cx + h_x * u_r + process_variance,
            C * u_y + S * u_v + D * u_cy + g_y * u_r,
            C * u_v - W * u_y + W * u_cy + h_y * u_r,
            u_cx, u_cy, u_r,
            C * y_y + S * y_v + D * y_cy + g_y * y_r,
            C * y_v - W * y_y + W * y_cy + h_y * y_r,
            y_cx, y_cy, y_r,
            C * v_v - W * v_y + W * v_cy + h_y * v_r + process_variance,
            v_cx, v_cy, v_r,
            p22, p23, p24, p25, p26, p27,
        )  # fmt: skip
        new_x, new_u = centre_x + C * from_x + S * u, C * u - W * from_x
        new_y, new_v = centre_y + C * from_y + S * v, C * v - W * from_y

        # x is measured, then y: together their joint density
        k = (
            predicted[0], predicted[1], predicted[2], predicted[3], predicted[4], predicted[5], predicted[6],
        )  # fmt: skip
        innovation_x = measurement[0, lane] - new_x
        sigma_x = k[0] + variance_x
        inverse_x = 1.0 / sigma_x
        halfway = condition(predicted, k, inverse_x)
        m = (
            halfway[2], halfway[8], halfway[13], halfway[14], halfway[15], halfway[16], halfway[17],
        )  # fmt: skip
        gain_x = innovation_x * inverse_x
        innovation_y = measurement[1, lane] - (new_y + k[2] * gain_x)
        sigma_y = m[2] + variance_y
        inverse_y = 1.0 / sigma_y
        corrected = condition(halfway, m, inverse_y)
        gain_y = innovation_y * inverse_y
        white_x, white_y = innovation_x * math.sqrt(inverse_x), innovation_y * math.sqrt(inverse_y)
        log_variance = 0.5 * (log(sigma_x) + log(sigma_y))

        # NaN and what would become it fail these comparisons
        sound = (
            (sigma_x > 0.5 * variance_x)
            & (sigma_y > 0.5 * variance_y)
            & (sigma_x + sigma_y < LARGEST * LARGEST)
            & (predicted[7] + predicted[18] < LARGEST * LARGEST)
            & (abs(innovation_x) + abs(innovation_y) + abs(new_u) + abs(new_v) < LARGEST)
            & (corrected[7] > -ROUNDING * predicted[7])
            & (corrected[18] > -ROUNDING * predicted[18])
        )
        kalman.x[lane] = new_x + k[0] * gain_x + m[0] * gain_y if sound else x
        kalman.vx[lane] = new_u + k[1] * gain_x + m[1] * gain_y if sound else u
        kalman.y[lane] = new_y + k[2] * gain_x + m[2] * gain_y if sound else y
        kalman.vy[lane] = new_v + k[3] * gain_x + m[3] * gain_y if sound else v
        kalman.centre_x[lane] = centre_x + k[4] * gain_x + m[4] * gain_y if sound else centre_x
        kalman.centre_y[lane] = centre_y + k[5] * gain_x + m[5] * gain_y if sound else centre_y
        kalman.turn_rate[lane] = rate + k[6] * gain_x + m[6] * gain_y if sound else rate
        innovation.white_x[lane] = white_x if sound else 0.0
        innovation.white_y[lane] = white_y if sound else 0.0
        innovation.log_variance[lane] = log_variance if sound else 2.0 * math.log(LARGEST)
        kalman.log_likelihood[lane] -= (
            LOG_TWO_PI + log_variance + 0.5 * (white_x * white_x + white_y * white_y) if sound else DIVERGED
        )
        P[0, lane] = corrected[0] if sound else p0
        P[1, lane] = corrected[1] if sound else p1
        P[2, lane] = corrected[2] if sound else p2
        P[3, lane] = corrected[3] if sound else p3
        P[4, lane] = corrected[4] if sound else p4
        P[5, lane] = corrected[5] if sound else p5
        P[6, lane] = corrected[6] if sound else p6
        P[7, lane] = corrected[7] if sound else p7
        P[8, lane] = corrected[8] if sound else p8
        P[9, lane] = corrected[9] if sound else p9
        P[10, lane] = corrected[10] if sound else p10
        P[11, lane] = corrected[11] if sound else p11
        P[12, lane] = corrected[12] if sound else p12
        P[13, lane] = corrected[13] if sound else p13
        P[14, lane] = corrected[14] if sound else p14
        P[15, lane] = corrected[15] if sound else p15
        P[16, lane] = corrected[16] if sound else p16
        P[17, lane] = corrected[17] if sound else p17
        P[18, lane] = corrected[18] if sound else p18
        P[19, lane] = corrected[19] if sound else p19
        P[20, lane] = corrected[20] if sound else p20
        P[21, lane] = corrected[21] if sound else p21
        P[22, lane] = corrected[22] if sound else p22
        P[23, lane] = corrected[23] if sound else p23
        P[24, lane] = corrected[24] if sound else p24
        P[25, lane] = corrected[25] if sound else p25
        P[26, lane] = corrected[26] if sound else p26
        P[27, lane] = corrected[27] if sound else p27


@internal
def step_aware(
    bank: AwareBank,
    first: int,
    last: int,
    measurement: NDArray[np.float64],
    tau: float,
    process_variance: float,
    variance_x: float,
    variance_y: float,
) -> None:
    """One tick of every hypothesis, for lanes first .. last - 1; arguments as in `bank.step_bank`."""
    for h in span(0, bank.hypotheses.size):
        kalman = in_place(bank.hypotheses[h])
        prefetch(kalman, bank.hypotheses.nbytes, AWARE)
        step_hypothesis(
            kalman, in_place(bank.innovations[h]), first, last, measurement,
            tau, process_variance, variance_x, variance_y,
        )  # fmt: skip


@internal
def anchor_covariance(hypotheses: NDArray[Any], hypothesis: int, lane: int) -> Ten:
    """Covariance of [x, vx, y, vy] of one hypothesis, upper triangle row by row."""
    P = in_place(hypotheses[hypothesis]).covariance
    return (
        P[0, lane], P[1, lane], P[2, lane], P[3, lane], P[7, lane], P[8, lane], P[9, lane],
        P[13, lane], P[14, lane], P[18, lane],
    )  # fmt: skip
