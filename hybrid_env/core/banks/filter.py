"""The equations of all filters: a filter is predicted by a turn or by a matrix, and corrected by a
measured position. It has states that begin with [x, vx, y, vy], [m, m/s], and their covariance, the
upper triangle row by row.

    predict_turn         a turn whose centre and turn rate are states too, with their uncertainty;
                         straight motion is the turn of rate 0
    predict_coordinated  a turn of a known radius by the estimated speed
    predict_linear       x' = F x + B + w, a mode of the user
    correct              a position; `sensing` has what radars measure, and a robust likelihood

The published bank has covariances of one axis, (position, velocity), which are predicted by
`vectors.sandwich` and corrected by `condition_x`.
"""

import math
from typing import Any

from hybrid_env.core.arrays import FloatArray
from hybrid_env.core.compilation import internal
from hybrid_env.core.elementary import log, sine_cosine
from hybrid_env.core.memory import State
from hybrid_env.core.motion import LARGEST_ANGLE, linear_motion, rows_of_matrix
from hybrid_env.core.vectors import (
    Vector,
    choose,
    combination,
    conditioned,
    resized,
    rows_of,
    sandwich,
    transposed,
    upper_triangle,
    widened,
)

LOG_TWO_PI = math.log(2.0 * math.pi)
# [m] or [m/s]; a filter with larger values has diverged.
LARGEST = 1e12
# Decrease of the log-likelihood in a tick of a diverged filter.
DIVERGED = 1e3

condition_x, condition_y = conditioned(0), conditioned(2)
of_four, of_six, of_seven = resized(4), resized(6), resized(7)

Filter = tuple[Vector, Vector]
"""State and covariance."""

Corrected = tuple[Vector, Vector, tuple[float, float, float], float]
"""State, covariance, (whitened innovation x and y, mean logarithm of its variance), and the
log-likelihood of the measurement.
"""


@internal
def turn_coefficients(angle: float) -> State:
    """Return (cos a, sin a, sin(a) / a, (1 - cos a) / a) of the angle a of a turn [rad]. In a tick
    of length tau a velocity (u, v) becomes (cos a u - sin a v, sin a u + cos a v), and the position
    changes by (along u - across v, across u + along v), along and across the last two times tau.
    """
    half = 0.5 * angle
    sine, cosine = sine_cosine(half)
    quotient = sine * (1.0 / half) if half != 0.0 else 1.0
    # Half angles avoid the cancellation of 1 - cos a.
    return 1.0 - 2.0 * sine * sine, 2.0 * sine * cosine, quotient * cosine, quotient * sine


@internal
def move_turn(state: Vector, tau: float) -> tuple[Vector, State, State]:
    """Return [x, vx, y, vy, centre_x, centre_y, turn_rate] a tick later, and its derivatives: (C,
    S, W, D), of which x' = C x + S vx + D centre_x and vx' = C vx - W x + W centre_x, likewise of
    y, and those of x, vx, y and vy by the turn rate. Golubkov 2018, eq. (1).
    """
    x, u, y, v, centre_x, centre_y, rate = state
    angle = rate * tau
    C, sine, along, across = turn_coefficients(angle)
    S, W = tau * along, rate * sine
    # Derivative of sin(a) / a by a, of small angles by its series.
    small = abs(angle) < 0.02
    square = angle * angle
    slope = (
        -angle * (1.0 / 3.0) * (1.0 - square * 0.1 * (1.0 - square * (1.0 / 28.0)))
        if small
        else (C - along) * (1.0 / (1.0 if small else angle))
    )
    dC, dS, dW = -tau * sine, tau * tau * slope, sine + angle * C
    from_x = x - centre_x
    from_y = y - centre_y
    moved = (
        centre_x + C * from_x + S * u,
        C * u - W * from_x,
        centre_y + C * from_y + S * v,
        C * v - W * from_y,
        centre_x,
        centre_y,
        rate,
    )
    by_rate = dC * from_x + dS * u, dC * u - dW * from_x, dC * from_y + dS * v, dC * v - dW * from_y
    return moved, (C, S, W, angle * across), by_rate


@internal
def _turn_times(turn: State, by_rate: State, rows: tuple[Vector, ...]) -> tuple[Vector, ...]:
    """Return the rows of F A of a matrix A, (7, 7), F the derivatives from `move_turn`."""
    C, S, W, D = turn
    g_x, h_x, g_y, h_y = by_rate
    x, u, y, v, centre_x, centre_y, rate = rows
    return (
        combination((C, S, D, g_x), (x, u, centre_x, rate)),
        combination((C, -W, W, h_x), (u, x, centre_x, rate)),
        combination((C, S, D, g_y), (y, v, centre_y, rate)),
        combination((C, -W, W, h_y), (v, y, centre_y, rate)),
        centre_x,
        centre_y,
        rate,
    )


@internal
def predict_turn(state: Vector, p: Vector, model: Any) -> Filter:
    """Return the predicted filter of a turn with uncertain centre and turn rate, whose covariance
    is F P F' + Q of a `FilterModel`. A drift of the measured positions moves the object and its
    centre by the same way.
    """
    moved, turn, by_rate = move_turn(state, model.tau)
    left = _turn_times(turn, by_rate, rows_of(widened(p)))
    p = upper_triangle(_turn_times(turn, by_rate, transposed(left)))
    Q, drift = model.process_variance, model.drift_variance
    of_x = p[0] + drift, *p[1:4], p[4] + drift, *p[5:7], p[7] + Q, *p[8:13]
    of_y = p[13] + drift, *p[14:16], p[16] + drift, p[17], p[18] + Q, *p[19:22]
    return moved, (*of_x, *of_y, p[22] + drift, *p[23:25], p[25] + drift, *p[26:])


@internal
def _straight_times(tau: float, rows: tuple[Vector, ...]) -> tuple[Vector, ...]:
    """Return the rows of F A of a matrix A, (4, 4), where F moves [x, vx, y, vy] by a tick along a
    straight line.
    """
    x, u, y, v = rows
    return combination((1.0, tau), (x, u)), u, combination((1.0, tau), (y, v)), v


@internal
def predict_straight(state: Vector, p: Vector, model: Any) -> Filter:
    """Return what `predict_turn` does of a turn of rate 0 without a drift, of the first four of its
    states: the others have no variance, and do not change.
    """
    x, u, y, v, centre_x, centre_y, _ = state
    left = _straight_times(model.tau, rows_of(widened(of_four(p))))
    p = upper_triangle(_straight_times(model.tau, transposed(left)))
    spread = (*p[:4], p[4] + model.process_variance, *p[5:9], p[9] + model.process_variance)
    # Rounded as a turn.
    moved_x = centre_x + (x - centre_x) + model.tau * u
    return (moved_x, u, centre_y + (y - centre_y) + model.tau * v, v), spread


@internal
def _coordinated_times(turn: State, rows: tuple[Vector, ...]) -> tuple[Vector, ...]:
    """Return the rows of F A of a matrix A, (4, 4), where F moves [x, vx, y, vy] by a tick; turn:
    from `turn_coefficients`, the last two times tau.
    """
    C, sine, along, across = turn
    x, u, y, v = rows
    return (
        combination((1.0, along, -across), (x, u, v)),
        combination((C, -sine), (u, v)),
        combination((1.0, across, along), (y, u, v)),
        combination((sine, C), (u, v)),
    )


@internal
def predict_coordinated(state: State, p: Vector, curvature: float, model: Any) -> Filter:
    """Return the predicted filter of a turn whose angle follows from the estimated speed and is
    then treated as known; curvature: 1 / radius, positive to the left [1/m].
    """
    x, u, y, v = state
    angle = curvature * math.sqrt(u * u + v * v) * model.tau
    angle = max(min(angle, LARGEST_ANGLE), -LARGEST_ANGLE)
    C, sine, along, across = turn_coefficients(angle)
    along, across = model.tau * along, model.tau * across
    turn = C, sine, along, across
    left = _coordinated_times(turn, rows_of(widened(p)))
    p = upper_triangle(_coordinated_times(turn, transposed(left)))
    Q, drift = model.process_variance, model.drift_variance
    moved = x + along * u - across * v, C * u - sine * v, y + across * u + along * v
    spread = (p[0] + drift, *p[1:4], p[4] + Q, *p[5:7], p[7] + drift, p[8], p[9] + Q)
    return (*moved, sine * u + C * v), spread


@internal
def triangle6(matrix: FloatArray) -> Vector:
    """Return the upper triangle of a matrix, (6, 6), row by row."""
    a, b, c, d, e, f = rows_of_matrix(matrix)
    return a + b[1:] + c[2:] + d[3:] + e[4:] + f[5:]


@internal
def predict_linear(state: Vector, p: Vector, motion: Any) -> Filter:
    """Return the predicted filter of a linear mode, a record `MOTION`: of seven states, whose first
    six are [x, vx, y, vy, ax, ay].
    """
    moved = sandwich(rows_of_matrix(motion.F), widened(of_six(p)))
    predicted = combination((1.0, 1.0), (moved, triangle6(motion.Q)))
    return (*linear_motion(motion, state[:6]), 0.0), of_seven(predicted)


@internal
def log_likelihood(white_x: float, white_y: float, log_variance: float) -> float:
    """Return ln N(innovation; 0, Sigma) of the tick, whose differences between hypotheses are the
    ratios of Golubkov 2018, eq. (4), from the whitened innovation and ln of its variance, mean of
    the axes.
    """
    return -(LOG_TWO_PI + log_variance + 0.5 * (white_x * white_x + white_y * white_y))


@internal
def correct(
    before: Filter, moved: Filter, measurement: FloatArray, lane: int, model: Any
) -> Corrected:
    """Return a filter corrected by a position, (2, LANES) [m]; before: a filter that diverges
    stays so.
    """
    state = moved[0]
    predicted = widened(moved[1])
    # Sequential corrections by x and y; the product of both densities is the joint density.
    rows = rows_of(predicted)
    by_x = rows[0]
    innovation_x = measurement[0, lane] - state[0]
    sigma_x = by_x[0] + model.variance_x
    inverse_x = 1.0 / sigma_x
    after_x = condition_x(predicted, by_x, model.variance_x * inverse_x, inverse_x)
    by_y = rows_of(after_x)[2]
    gain_x = innovation_x * inverse_x
    innovation_y = measurement[1, lane] - (state[2] + by_x[2] * gain_x)
    sigma_y = by_y[2] + model.variance_y
    inverse_y = 1.0 / sigma_y
    corrected = condition_y(after_x, by_y, model.variance_y * inverse_y, inverse_y)
    factors = 1.0, gain_x, innovation_y * inverse_y
    white_x = innovation_x * math.sqrt(inverse_x)
    white_y = innovation_y * math.sqrt(inverse_y)
    log_variance = 0.5 * (log(sigma_x) + log(sigma_y))
    # These comparisons are False for NaN and for values that would lead to NaN.
    innovations = abs(innovation_x) + abs(innovation_y)
    valid = (
        (sigma_x + sigma_y < LARGEST * LARGEST)
        & (rows[1][1] + rows[3][3] < LARGEST * LARGEST)
        & (innovations + abs(state[1]) + abs(state[3]) < LARGEST)
    )
    told = (
        white_x if valid else 0.0,
        white_y if valid else 0.0,
        log_variance if valid else 2.0 * math.log(LARGEST),
    )
    return (
        choose(valid, combination(factors, (state, by_x, by_y)), before[0]),
        choose(valid, corrected, before[1]),
        told,
        log_likelihood(white_x, white_y, log_variance) if valid else -DIVERGED,
    )


@internal
def uncorrected(before: Filter, moved: Filter, model: Any) -> Corrected:
    """Return a predicted filter in a tick without a measurement, as `correct`."""
    state, p = moved
    rows = rows_of(p)
    sigma_x, sigma_y = rows[0][0] + model.variance_x, rows[2][2] + model.variance_y
    valid = (
        (sigma_x + sigma_y < LARGEST * LARGEST)
        & (rows[1][1] + rows[3][3] < LARGEST * LARGEST)
        & (abs(state[1]) + abs(state[3]) < LARGEST)
    )
    log_variance = 0.5 * (log(sigma_x) + log(sigma_y)) if valid else 2.0 * math.log(LARGEST)
    after, p = choose(valid, state, before[0]), choose(valid, p, before[1])
    return after, p, (0.0, 0.0, log_variance), 0.0
