"""Modes of every kind at three scales with their literal matrices, and filters of them in matrix
form.
"""

import math

import numpy as np
from matrix_filters import (
    LinearFilter,
    LiteralImm,
    MatrixExtendedKalmanFilter,
    MatrixFilter,
    MatrixKalmanFilter,
    jacobian,
    merged,
    turn_matrix,
)
from scipy import linalg

from hybrid_env.core.memory import PublishedBank
from hybrid_env.live import SQUARE
from hybrid_env.modes import Accelerate, LinearMode, Mode, Stop, Straight, Turn, TurnRate

SCALES = {
    "walker": {"speed": 1.4, "tau": 0.5, "process_variance": 0.002, "measurement_variance": 4.0},
    "car": {"speed": 15.0, "tau": 0.1, "process_variance": 0.01, "measurement_variance": 1.0},
    "aircraft": {
        "speed": 220.0,
        "tau": 4.0,
        "process_variance": 1.0,
        "measurement_variance": 2500.0,
    },
}
"""Options of an object of each kind."""

# Singular and correlated, of [x, vx, y, vy], in standard deviations of a measurement and of the
# process noise.
ROOT = np.array([[0.1, 0.0, 0.0], [0.5, 1.0, 0.0], [0.0, -0.1, 0.1], [0.3, 0.0, 2.0]])
# Places of [x, vx, y, vy, ax, ay], the states of the filters here, in those of a mode.
ORDER = [0, 1, 3, 4, 2, 5]


class Halt(Mode):
    """A stop as a user writes it: the velocity is lost, and the object stands."""

    def matrices(self, tau):
        """Return F, B and Q."""
        return np.diag([1.0, 0.0, 1.0, 0.0]), np.zeros(4), None


def continuous(A, tau):
    """Return the transition matrix of a tick of x' = A x."""
    return linalg.expm(tau * np.array(A, float))


def every_mode(scale="car"):
    """Return modes of all kinds."""
    speed, tau, Q, R = SCALES[scale].values()
    gain = 0.01 * speed / tau
    # To a wind, with noise of its own on all states.
    drag = continuous(np.kron(np.eye(2), [[0, 1], [0, -0.005 / tau]]), tau)
    wind = np.array([0.0, 0.002 * speed, 0.0, -0.001 * speed])
    root = np.sqrt([R, Q, R, Q])[:, None] * ROOT
    # Accelerations as in Singer 1970.
    singer = continuous(np.kron(np.eye(2), [[0, 1, 0], [0, 0, 1], [0, 0, -0.2 / tau]]), tau)
    singer_noise = np.diag([0.0, 0.0, 0.3, 0.0, 0.0, 0.3]) * gain**2
    return (
        Straight(),
        Turn(15 * speed * tau),
        Turn(-25 * speed * tau),
        Stop(),
        Halt(),
        Accelerate(gain),
        Accelerate(-0.3 * gain),
        TurnRate(-0.06 / tau),
        LinearMode(drag, wind, root @ root.T, name="drag"),
        LinearMode(singer, None, singer_noise, name="singer"),
    )


def noise_of(options):
    """Return Q of [x, vx, y, vy]."""
    return np.diag(2 * [options.drift_variance, options.process_variance])


def literal_matrices(mode, options):
    """Return F, B and Q of a mode of the plane in the order of the filter, and its acceleration
    along the heading; a turn of a radius has none of them.
    """
    tau, noise = options.tau, noise_of(options)
    if isinstance(mode, Turn):
        return None
    if isinstance(mode, Accelerate):
        F, B = continuous(np.kron(np.eye(2), np.eye(3, k=1)), tau), np.zeros(6)
        noise = np.diag([0.0, noise[1, 1], 0.0, 0.0, noise[3, 3], 0.0])
    elif isinstance(mode, LinearMode | Halt):
        F, B, own = mode.matrices(tau)
        noise = noise if own is None else own
    else:
        w = getattr(mode, "rate", 0.0)
        turning = [[0, 1, 0, 0], [0, 0, 0, -w], [0, 0, 0, 1], [0, w, 0, 0]]
        F = np.eye(4) if isinstance(mode, Stop) else continuous(turning, tau)
        B = np.zeros(4)
    if len(F) == 6:
        F, B, noise = F[np.ix_(ORDER, ORDER)], B[ORDER], noise[np.ix_(ORDER, ORDER)]
    return F, B, noise, getattr(mode, "acceleration", 0.0)


def filter_of_mode(options, number, anchor, P, exact=False):
    """Return the filter of a mode in the plane; an exact anchor has no error of the centre of a
    turn, nor of an acceleration.
    """
    mode = options.all_modes[number].planar
    R, freedom = np.broadcast_to(options.variances, 2), options.freedom
    given = literal_matrices(mode, options)
    if given is None:
        turn = anchor, P, mode.signed_radius, options.tau, options.process_variance, R, freedom
        if exact:
            return MatrixKalmanFilter(*turn)
        return MatrixExtendedKalmanFilter(*turn, options.drift_variance)
    F, B, Q, acceleration = given
    x = np.array(anchor)
    if len(F) == 6:

        def begun(state):
            _, vx, _, vy = state
            a = acceleration / np.sqrt(vx * vx + vy * vy)
            return np.array([*state, a * vx, a * vy])

        J = np.eye(6)[:, :4] if exact else jacobian(begun, x)
        x, P = begun(x), J @ P @ J.T
    kalman = LinearFilter(x, P, F, B, Q, R, freedom)
    kalman.stands = isinstance(mode, Stop)
    return kalman


class SpatialFilter(MatrixFilter):
    """A filter of the states of one of the plane and of [z, vz], with full matrices."""

    seen = (0, 2, -2)

    def __init__(self, plane, options, rate, height, variance):
        self.plane, self.options = plane, options
        self.x = np.append(plane.x, [height, rate])
        self.P = linalg.block_diag(plane.P, np.diag([variance, 0.0]))

    def linearised(self):
        """See `MatrixFilter`."""
        self.plane.x = self.x[:-2]
        moved, F, Q = self.plane.linearised()
        rising, noise = vertical(self.options)
        x = np.append(moved, rising @ self.x[-2:])
        return x, linalg.block_diag(F, rising), linalg.block_diag(Q, noise)


def vertical(options):
    """Return F and Q of [z, vz]."""
    return np.array([[1.0, options.tau], [0.0, 1.0]]), np.diag([0.0, options.climb_variance])


def filters_of_modes(env, i, variance):
    """Return the filters of track i, before the first tick of its segment. variance: of the height
    of the anchor.
    """
    options = env.options
    exact = options.bank != "anchor_aware"
    anchor = env.world.field("anchor")[i]
    P = env.world.field("covariance")[i][SQUARE]
    if options.parameters()["reset_covariance"]:
        P = np.eye(4)
    # Which filters each axis by itself.
    if options.bank_class is PublishedBank:
        P = P * np.kron(np.eye(2), np.ones((2, 2)))
    filters = [filter_of_mode(options, k, anchor, P, exact) for k in range(options.hypotheses)]
    if options.climbs:
        height = env.world.field("anchor_height")[i]
        filters = [
            SpatialFilter(kalman, options, mode.rate, height, variance)
            for kalman, mode in zip(filters, options.all_modes, strict=True)
        ]
    return filters


class ImmOfModes(LiteralImm):
    """The IMM of modes, with the states [x, vx, y, vy, ax, ay, z, vz].

    Accelerations are those of a mode, and 0 at a switch; a filter brings its height to the others,
    whose modes have their rates. Plane and height stay uncorrelated.
    """

    def __init__(self, estimate, P, options, transition):
        self.options, self.freedom = options, options.freedom
        self.given = [literal_matrices(mode.planar, options) for mode in options.all_modes]
        self.rates_up = [getattr(mode, "rate", 0.0) * options.climbs for mode in options.all_modes]
        start = linalg.block_diag(P, np.zeros((4, 4)))
        parts = [(np.array([*estimate, 0.0, 0.0, 0.0, rate]), start) for rate in self.rates_up]
        super().__init__(parts, transition, np.diag(np.broadcast_to(options.variances, 2)))
        if options.climbs:
            self.seen = (0, 2, 6)

    def stands(self, j):
        """Whether the object stands in mode j."""
        return isinstance(self.options.all_modes[j].planar, Stop)

    def mixed(self, j, weights):
        """Return state and covariance in which filter j begins a tick."""
        kept = np.diag([1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0])
        rate = np.append(np.zeros(7), self.rates_up[j])
        parts = [(kept @ x + rate, kept @ P @ kept) for x, P in self.parts]
        parts[j] = self.parts[j]
        mean, spread = merged(weights, parts)
        spread[:6, 6:] = spread[6:, :6] = 0.0
        return mean, spread

    def predicted(self, j, x, P):
        """Return the prediction of filter j."""
        options = self.options
        given = self.given[j]
        if given is None:
            F = turn_matrix(x, 1 / options.all_modes[j].signed_radius, options.tau)
            given = F, np.zeros(4), noise_of(options), 0.0
        F, B, Q, acceleration = given
        if acceleration:
            x = np.array([*x[:4], *acceleration * x[[1, 3]] / math.hypot(x[1], x[3]), *x[6:]])
            P[4:6] = P[:, 4:6] = 0.0
        rising, noise = vertical(options)
        without = np.zeros((6 - len(F), 6 - len(F)))
        F, Q = (linalg.block_diag(A, without, C) for A, C in ((F, rising), (Q, noise)))
        return F @ x + np.append(B, np.zeros(8 - len(B))), F @ P @ F.T + Q


def step_filters(filters, env, i):
    """Advance the filters of track i by what is measured in the tick."""
    options = env.options
    z, noise, rates = (env.world.field(name)[i] for name in ("measurement", "noise", "rates"))
    deviations = np.sqrt(np.broadcast_to(options.variances, 2))
    missing = np.isnan(z).any()
    ratio = np.eye(2) if missing else noise[[[0, 1], [1, 2]]]
    R = ratio * np.outer(deviations, deviations)
    if options.climbs:
        z, R = (
            np.append(z, env.world.field("height")[i]),
            linalg.block_diag(R, options.height_variance),
        )
    measured = []
    for sensor in options.sensors:
        seen, rates = rates[: sensor.rates], rates[sensor.rates :]
        if sensor.rates == 2:
            measured.append((seen, None, math.sqrt(sensor.velocity_variance)))
        elif sensor.rates == 1 and sensor.places:
            measured.append((seen[0], sensor.position, sensor.rate_deviation))
        elif sensor.rates == 1:
            kind = "bearing" if sensor.range_deviation is None else "range"
            deviation = sensor.range_deviation or sensor.bearing_deviation
            measured.append((seen[0], sensor.position, deviation, kind))
    for kalman in filters:
        kalman.R = R
        kalman.rates = [each for each in measured if not np.isnan(each[0]).any()]
        kalman.step(None if missing else z)
