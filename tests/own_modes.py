"""Modes of every kind at three scales with their literal matrices, and filters of them in matrix
form.
"""

import numpy as np
from matrix_filters import (
    LiteralImm,
    MatrixExtendedKalmanFilter,
    MatrixFilter,
    MatrixKalmanFilter,
    jacobian,
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


class Halt(Mode):
    """A stop as a user writes it: the velocity is lost, and the object stands."""

    def matrices(self, tau):
        """Return F, B and Q."""
        return np.diag([1.0, 0.0, 1.0, 0.0]), np.zeros(4), None


def continuous(A, tau):
    """Return the transition matrix of a tick of x' = A x."""
    return linalg.expm(tau * np.array(A, float))


def described(scale):
    """Return modes of all kinds at a scale, each with its F, B and Q in the order of its states,
    and with its acceleration along the heading; a turn of a radius has none of them.
    """
    speed, tau, Q, R = SCALES[scale].values()
    noise = np.diag([0.0, Q, 0.0, Q])
    axis = [[0, 1, 0], [0, 0, 1], [0, 0, 0]]
    constant = continuous(linalg.block_diag(axis, axis), tau)
    constant_noise = np.diag([0.0, Q, 0.0, 0.0, Q, 0.0])
    rate, gain = -0.06 / tau, 0.01 * speed / tau
    turning = [[0, 1, 0, 0], [0, 0, 0, -rate], [0, 0, 0, 1], [0, rate, 0, 0]]
    # To a wind, with noise of its own on all states.
    slower = [[0, 1], [0, -0.005 / tau]]
    drag = continuous(linalg.block_diag(slower, slower), tau)
    wind = np.array([0.0, 0.002 * speed, 0.0, -0.001 * speed])
    root = np.sqrt([R, Q, R, Q])[:, None] * ROOT
    # Accelerations as in Singer 1970.
    held = [[0, 1, 0], [0, 0, 1], [0, 0, -0.2 / tau]]
    singer = continuous(linalg.block_diag(held, held), tau)
    singer_noise = np.diag([0.0, 0.0, 0.3, 0.0, 0.0, 0.3]) * gain**2
    straight = continuous(np.kron(np.eye(2), [[0, 1], [0, 0]]), tau)
    zero = np.zeros(4)
    return {
        Straight(): (straight, zero, noise, 0.0),
        Turn(15 * speed * tau): None,
        Turn(-25 * speed * tau): None,
        Stop(): (np.eye(4), zero, noise, 0.0),
        Halt(): (np.diag([1.0, 0.0, 1.0, 0.0]), zero, noise, 0.0),
        Accelerate(gain): (constant, np.zeros(6), constant_noise, gain),
        Accelerate(-0.3 * gain): (constant, np.zeros(6), constant_noise, -0.3 * gain),
        TurnRate(rate): (continuous(turning, tau), zero, noise, 0.0),
        LinearMode(drag, wind, root @ root.T, name="drag"): (drag, wind, root @ root.T, 0.0),
        LinearMode(singer, None, singer_noise, name="singer"): (
            singer,
            np.zeros(6),
            singer_noise,
            0.0,
        ),
    }


def every_mode(scale="car"):
    """Return modes of all kinds."""
    return tuple(described(scale))


class LinearFilter(MatrixFilter):
    """A Kalman filter of x' = F x + B + w of the state [x, vx, y, vy], or [x, vx, ax, y, vy, ay]
    with an acceleration along the heading of the anchor.
    """

    def __init__(self, anchor, P, matrices, exact, freedom=0):
        self.F, self.B, self.Q, acceleration = matrices
        self.freedom = freedom
        self.x, self.P = np.array(anchor), np.array(P)
        if len(self.F) == 6:

            def begun(state):
                x, vx, y, vy = state
                a = acceleration / np.sqrt(vx * vx + vy * vy)
                return np.array([x, vx, a * vx, y, vy, a * vy])

            self.x = begun(self.x)
            J = np.delete(np.eye(6), [2, 5], axis=1) if exact else jacobian(begun, anchor)
            self.P = J @ P @ J.T
        # In the order [x, vx, y, vy, ax, ay] from here on.
        order = [0, 1, 3, 4, 2, 5] if len(self.F) == 6 else range(4)
        self.x, self.B = self.x[order], self.B[order]
        self.F, self.P, self.Q = (A[np.ix_(order, order)] for A in (self.F, self.P, self.Q))

    def predicted(self):
        """Return state and covariance one tick later."""
        return self.F @ self.x + self.B, self.F @ self.P @ self.F.T + self.Q


def filter_of_mode(options, mode, anchor, P, exact=False):
    """Return the filter of a mode of options; an exact anchor has no error of the centre of a
    turn.
    """
    motion, Q = options.all_modes[mode], options.process_variance
    R = np.broadcast_to(options.variances, 2)
    if isinstance(motion, (Stop, Accelerate)):
        F, B, _ = motion.matrices(options.tau)
        noise = np.kron(np.eye(2), np.diag([0.0, Q, 0.0][: len(F) // 2]))
        given = F, B, noise, motion.starting_acceleration
        kalman = LinearFilter(anchor, P, given, exact=True, freedom=options.freedom)
        kalman.R = R
        return kalman
    kind = MatrixKalmanFilter if exact else MatrixExtendedKalmanFilter
    return kind(anchor, P, motion.signed_radius, options.tau, Q, R, options.freedom)


def filters_of_modes(env, i, matrices):
    """Return the filters of track i, before the first tick of its segment. matrices: see
    `described`; straight motion may have none, too.
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
    freedom = options.freedom
    filters = []
    for mode, given in matrices.items():
        turn = (mode.signed_radius, options.tau, options.process_variance, None, freedom)
        if given is not None:
            filters.append(LinearFilter(anchor, P, given, exact, freedom))
            filters[-1].stands = isinstance(mode, Stop)
        elif exact:
            filters.append(MatrixKalmanFilter(anchor, P, *turn))
        else:
            filters.append(MatrixExtendedKalmanFilter(anchor, P, *turn, options.drift_variance))
    return filters


class ImmOfModes(LiteralImm):
    """The same for any modes and any transition matrix. Filters have the states [x, vx, y, vy, ax,
    ay]; accelerations are those of a mode, and 0 at a switch.
    """

    def __init__(self, estimate, P, matrices, transition, tau, Q, freedom=0):
        self.modes = list(matrices.items())
        start = np.append(estimate, [0.0, 0.0]), linalg.block_diag(P, np.zeros((2, 2)))
        super().__init__(*start, self.modes, transition, tau, Q, (1.0, 1.0), freedom)
        self.GQG = linalg.block_diag(self.GQG, np.zeros((2, 2)))

    def stands(self, j):
        """Whether the object stands in mode j."""
        return isinstance(self.modes[j][0], Stop)

    def mixed(self, j, weights):
        """Return state and covariance in which filter j begins a tick."""
        without = np.diag([1.0, 1.0, 1.0, 1.0, 0.0, 0.0])
        parts = [np.eye(6) if g == j else without for g in range(len(weights))]
        kept = self.states, self.covariances
        self.states = [A @ x for A, x in zip(parts, self.states, strict=True)]
        self.covariances = [A @ P @ A for A, P in zip(parts, self.covariances, strict=True)]
        begun = self.merged(weights)
        self.states, self.covariances = kept
        return begun

    def predicted(self, j, x, P):
        """Return the prediction of filter j."""
        mode, given = self.modes[j]
        if given is None:
            F = linalg.block_diag(
                turn_matrix(x, 1 / mode.signed_radius, self.tau), np.zeros((2, 2))
            )
            return F @ x, F @ P @ F.T + self.GQG
        F, B, Q, acceleration = given
        if len(F) == 4:
            F, Q = (linalg.block_diag(A, np.zeros((2, 2))) for A in (F, Q))
            return F @ x + np.append(B, [0.0, 0.0]), F @ P @ F.T + Q
        order = [0, 1, 3, 4, 2, 5]
        F, Q = (A[np.ix_(order, order)] for A in (F, Q))
        if acceleration:
            x = np.append(x[:4], acceleration * x[[1, 3]] / np.hypot(x[1], x[3]))
            P = linalg.block_diag(P[:4, :4], np.zeros((2, 2)))
        return F @ x + B[order], F @ P @ F.T + Q
