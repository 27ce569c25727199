"""Speed and radius of a turning object with their deviations, although its radius is not known.

The filters of the banks take the radius of their hypothesis as exact at the switch: their centre
and turn rate have errors, but the radius that follows from both has none, and it hardly follows an
object that turns with another one. The filter of this file begins at the same estimate, with a
radius that is not known. Its state is [x, y, vx, vy, ux, uy, turn rate]. u is the velocity of the
circle about the centre through the position: the centre is (x - uy / rate, y + ux / rate). At the
switch u is the velocity v of the object. Later both differ by the process noise, which changes v
only: Golubkov 2018, eq. (1). Without noise v + u is turned by the turn rate, and v - u against it.

Given the turn rate, the motion is linear, and so is the condition u = v at the switch, whatever the
radius is. Centre and turn rate as states would be bound by a product of both.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from hybrid_env.checks import FloatArray, Moments, OwnState
from hybrid_env.compiled import compiled, internal, prepare, turn_coefficients

STATES = 7
# Relative deviation of the curvature of a turn from that of its mode.
SPREAD = 0.5


class TurnEstimate(NamedTuple):
    """Speed and radius of an object, in the units of its positions and times.

    Attributes:
        speed: [m/s].
        speed_deviation: standard deviation of its error.
        radius: speed over turn rate [m]; infinite if the motion is straight, NaN if the object
            stands or the mode is not decided.
        radius_deviation: standard deviation of its error; NaN unless the object turns.
    """

    speed: float
    speed_deviation: float
    radius: float
    radius_deviation: float


@internal
def turn_matrix(rate: float, seconds: float) -> FloatArray:
    """Return the matrix (6, 6) by which positions, v and u move in a time without noise."""
    cosine, sine, along, across = turn_coefficients(rate * seconds)
    matrix = np.eye(6)
    for k in range(2):
        # A left turn by 90 degrees moves coordinate `other` to k.
        other = 1 - k
        sign = 2.0 * k - 1.0
        matrix[k, 2 + k] = seconds * along
        matrix[k, 4 + other] = sign * seconds * across
        matrix[2 + k, 2 + k] = matrix[4 + k, 4 + k] = cosine
        matrix[2 + k, 4 + other] = matrix[4 + k, 2 + other] = sign * sine
    return matrix


@internal
def turned_estimate(
    state: FloatArray, covariance: FloatArray, seconds: float
) -> tuple[FloatArray, FloatArray]:
    """Return state (7,) and covariance (7, 7) after a time without noise: the mean of the linear
    motions at the nodes of the turn rate, whose weights integrate polynomials up to the fifth
    degree exactly. To first order the filter would become too certain while the rate is not well
    known.
    """
    # Quadrature of Gauss and Hermite for a normal distribution.
    nodes = -math.sqrt(3.0), 0.0, math.sqrt(3.0)
    weights = 1.0 / 6.0, 2.0 / 3.0, 1.0 / 6.0
    deviation = math.sqrt(max(covariance[6, 6], 0.0))
    with_rate = covariance[6, :6].copy()
    # Derivative of the other states by the turn rate.
    slope = with_rate / deviation**2 if deviation > 0.0 else 0.0 * with_rate
    given = covariance[:6, :6] - np.outer(slope, with_rate)
    means = np.empty((3, 6))
    moved = np.zeros(STATES)
    moved[6] = state[6]
    predicted = np.zeros((STATES, STATES))
    predicted[6, 6] = covariance[6, 6]
    for k in range(3):
        error = nodes[k] * deviation
        matrix = turn_matrix(state[6] + error, seconds)
        means[k] = matrix @ (state[:6] + error * slope)
        moved[:6] += weights[k] * means[k]
        predicted[:6, :6] += weights[k] * (matrix @ given @ matrix.T)
    for k in range(3):
        apart = means[k] - moved[:6]
        predicted[:6, :6] += weights[k] * np.outer(apart, apart)
        predicted[:6, 6] += weights[k] * nodes[k] * deviation * apart
    predicted[6, :6] = predicted[:6, 6]
    return moved, predicted


@compiled
def _advance(
    states: FloatArray,
    covariances: FloatArray,
    turns: FloatArray,
    positions: FloatArray,
    noises: FloatArray,
    tau: float,
    process_variance: float,
    first: int,
    last: int,
) -> None:
    """Predict states first .. last - 1 of (B, 7) by a tick, correct those with a position (B, 2),
    of noise (B, 3) xx, xy, yy, NaN is none, and write their turns (B, 4).
    """
    for b in range(first, last):
        state, covariance = turned_estimate(states[b], covariances[b], tau)
        covariance[2, 2] += process_variance
        covariance[3, 3] += process_variance
        xx = covariance[0, 0] + noises[b, 0]
        xy = covariance[0, 1] + noises[b, 1]
        yy = covariance[1, 1] + noises[b, 2]
        determinant = xx * yy - xy * xy
        # This is False for a covariance that is NaN, too.
        if determinant > 0.0 and not math.isnan(positions[b, 0] + positions[b, 1]):
            error_x = positions[b, 0] - state[0]
            error_y = positions[b, 1] - state[1]
            by_x = covariance[:, 0].copy()
            by_y = covariance[:, 1].copy()
            gain_x = (yy * by_x - xy * by_y) / determinant
            gain_y = (xx * by_y - xy * by_x) / determinant
            state += gain_x * error_x + gain_y * error_y
            for i in range(STATES):
                for j in range(STATES):
                    covariance[i, j] -= gain_x[i] * by_x[j] + gain_y[i] * by_y[j]
        states[b] = state
        # Rounding errors that are not symmetric would grow.
        covariances[b] = 0.5 * (covariance + covariance.T)
        values = turn_of(state, covariances[b])
        for k in range(4):
            turns[b, k] = values[k]


def begin_turn(
    estimate: FloatArray, covariance: FloatArray, curvature: float, deviation: float
) -> Moments:
    """Return state (7,) and covariance (7, 7) of an object that begins to turn.

    Args:
        estimate: (4,) [x, vx, y, vy] [m, m/s].
        covariance: (4, 4) of the estimate.
        curvature: 1 / radius, positive to the left, 0 is straight [1/m].
        deviation: of the curvature, whose error does not depend on that of the estimate [1/m].
    """
    x, vx, y, vy = estimate
    speed = math.hypot(vx, vy)
    # The heading of an object at rest is not known.
    along = np.array([vx, vy]) / speed if speed > 0.0 else np.zeros(2)
    of_estimate = np.zeros((STATES, 4))
    of_estimate[[0, 1], [0, 2]] = 1.0
    of_estimate[[2, 3, 4, 5], [1, 3, 1, 3]] = 1.0
    of_estimate[6, 1::2] = curvature * along
    matrix = of_estimate @ covariance @ of_estimate.T
    matrix[6, 6] += (speed * deviation) ** 2
    return np.array([x, y, vx, vy, vx, vy, curvature * speed]), matrix


def begin_standing(estimate: FloatArray, covariance: FloatArray) -> Moments:
    """Return state (7,) and covariance (7, 7) of an object that stands; arguments as of
    `begin_turn`.
    """
    kept = np.array([1.0, 0.0, 1.0, 0.0])
    return begin_turn(estimate * kept, covariance * np.outer(kept, kept), 0.0, 0.0)


@internal
def speed_of(vx: float, vy: float, xx: float, xy: float, yy: float) -> tuple[float, float]:
    """Return the speed of a velocity and its deviation, from the covariance of the velocity."""
    square = vx * vx + vy * vy
    if square == 0.0:
        return 0.0, math.sqrt(xx + yy)
    variance = (vx * vx * xx + 2.0 * vx * vy * xy + vy * vy * yy) / square
    return math.sqrt(square), math.sqrt(max(variance, 0.0))


@internal
def turn_of(state: FloatArray, covariance: FloatArray) -> tuple[float, float, float, float]:
    """Return speed and radius of a turn with their deviations, see `TurnEstimate`, to first
    order in the covariance (7, 7) of its state (7,). The radius is speed / |turn rate|.
    """
    vx, vy, rate = state[2], state[3], state[6]
    xx, xy, yy = covariance[2, 2], covariance[2, 3], covariance[3, 3]
    speed, speed_deviation = speed_of(vx, vy, xx, xy, yy)
    if rate == 0.0:
        return speed, speed_deviation, math.inf, math.nan
    if speed == 0.0:
        return speed, speed_deviation, 0.0, math.nan
    # Covariance of the speed and the turn rate.
    with_rate = (vx * covariance[2, 6] + vy * covariance[3, 6]) / speed
    # Relative to the square of the radius.
    variance = (speed_deviation / speed) ** 2 + covariance[6, 6] / rate**2
    variance -= 2.0 * with_rate / (speed * rate)
    radius = speed / abs(rate)
    return speed, speed_deviation, radius, radius * math.sqrt(max(variance, 0.0))


class TurnFilter(OwnState):
    """Filters of B turns whose radii are not known, see the top of this file.

    Args:
        tau: length of a tick [s].
        process_variance: Q, variance of the noise added to each velocity at every tick [m^2/s^2].
        turns: B.

    Attributes:
        states: (B, 7) [x, y, vx, vy, ux, uy, turn rate] [m, m/s, rad/s].
        covariances: (B, 7, 7)
        turns: (B, 4) values of `TurnEstimate`.
    """

    def __init__(self, tau: float, process_variance: float, turns: int = 1):
        self.tau = tau
        self.process_variance = process_variance
        self.states = np.full((turns, STATES), np.nan)
        self.covariances = np.full((turns, STATES, STATES), np.nan)
        self.turns = np.full((turns, 4), np.nan)
        self._positions = np.full((turns, 2), np.nan)
        self._noises = np.zeros((turns, 3))
        state = self.states, self.covariances, self.turns
        measured = self._positions, self._noises
        self._arguments: Any = *state, *measured, self.tau, self.process_variance
        prepare(_advance, *self._arguments, 0, turns)

    def begin(self, turn: int, state: FloatArray, covariance: FloatArray) -> None:
        """Begin a turn with a state (7,) and a covariance (7, 7), see `begin_turn`."""
        self.states[turn], self.covariances[turn] = state, covariance
        self.turns[turn] = turn_of(state, covariance)

    def moments(self, turn: int = 0) -> Moments:
        """Return copies of state (7,) and covariance (7, 7) of a turn."""
        return self.states[turn].copy(), self.covariances[turn].copy()

    def step(self, positions: ArrayLike, noises: ArrayLike, only: int | None = None) -> None:
        """Advance all turns or one of them by a tick with measured positions, (B, 2) or (2,) [m],
        NaN without one, and their covariances xx, xy, yy, (B, 3) or (3,) [m^2].
        """
        self._positions[:] = positions
        self._noises[:] = noises
        each = (0, len(self.states)) if only is None else (only, only + 1)
        _advance(*self._arguments, *each)

    def turn(self, turn: int = 0) -> TurnEstimate:
        """Return speed and radius of a turn, and their deviations."""
        return TurnEstimate(*self.turns[turn].tolist())
