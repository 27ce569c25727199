"""Reference filters for the tests, in matrix form as in the papers."""

import math

import numpy as np


class MatrixKalmanFilter:
    """Kalman filter with four states. Golubkov 2018, eq. (1) and (2), with Sigma = H P H' + R."""

    def __init__(self, state, P, mode, radius, tau, Q, R):
        xs, vx, ys, vy = state
        self.x, self.P, self.R = np.array(state), P.copy(), R
        self.log_likelihood = 0.0
        if mode == "S":
            block = np.array([[1.0, tau], [0.0, 1.0]])
            self.B = np.zeros(4)
        else:
            w = math.hypot(vx, vy) / radius
            c, s = math.cos(w * tau), math.sin(w * tau)
            block = np.array([[c, s / w], [-w * s, c]])
            sign = 1.0 if mode == "L" else -1.0
            self.B = np.array(
                [
                    (xs - sign * vy / w) * (1 - c),
                    (w * xs - sign * vy) * s,
                    (ys + sign * vx / w) * (1 - c),
                    (w * ys + sign * vx) * s,
                ]
            )
        self.Phi = np.kron(np.eye(2), block)
        G = np.array([[0, 0], [1, 0], [0, 0], [0, 1.0]])
        self.GQG = G @ (Q * np.eye(2)) @ G.T
        self.H = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0]])

    def step(self, z):
        x = self.Phi @ self.x + self.B
        P = self.Phi @ self.P @ self.Phi.T + self.GQG
        self.innovation = z - self.H @ x
        self.Sigma = self.H @ P @ self.H.T + self.R
        K = P @ self.H.T @ np.linalg.inv(self.Sigma)
        self.x = x + K @ self.innovation
        self.P = P - K @ self.H @ P
        quadratic = self.innovation @ np.linalg.solve(self.Sigma, self.innovation)
        self.log_likelihood -= 0.5 * (quadratic + math.log(np.linalg.det(2 * math.pi * self.Sigma)))


def move(state, tau):
    """Move [x, vx, y, vy, centre_x, centre_y, turn_rate] by one tick. Golubkov 2018, eq. (1), no noise."""
    x, vx, y, vy, cx, cy, w = state
    c, s = math.cos(w * tau), math.sin(w * tau)
    ratio = s / w if w else tau
    return np.array(
        [cx + c * (x - cx) + ratio * vx, c * vx - w * s * (x - cx),
         cy + c * (y - cy) + ratio * vy, c * vy - w * s * (y - cy), cx, cy, w]
    )  # fmt: skip


def turn_state(anchor, signed_radius):
    """Return [x, vx, y, vy, centre_x, centre_y, turn_rate] of a turn that begins at [x, vx, y, vy]."""
    x, vx, y, vy = anchor
    v = math.hypot(vx, vy)
    return np.array(
        [x, vx, y, vy, x - signed_radius * vy / v, y + signed_radius * vx / v, v / abs(signed_radius)]
    )


def jacobian(function, state):
    """Return the Jacobian by central differences."""
    columns = []
    for k in range(len(state)):
        h = 1e-5 * max(1.0, abs(state[k]))
        step = h * np.eye(len(state))[k]
        columns.append((function(state + step) - function(state - step)) / (2 * h))
    return np.array(columns).T


class MatrixExtendedKalmanFilter:
    """Extended Kalman filter with seven states. Jacobians are computed by central differences."""

    def __init__(self, anchor, P, signed_radius, tau, Q, R):
        self.tau, self.R = tau, R
        self.Q = np.diag([0, Q, 0, Q, 0, 0, 0])
        self.log_likelihood = 0.0
        if signed_radius == 0.0:
            self.s = np.array([*anchor, 0.0, 0.0, 0.0])
            J = np.eye(7)[:, :4]
        else:
            self.s = turn_state(anchor, signed_radius)
            J = jacobian(lambda state: turn_state(state, signed_radius), np.array(anchor))
        self.P = J @ P @ J.T

    def step(self, z):
        F = jacobian(lambda state: move(state, self.tau), self.s)
        if self.s[6] == 0.0:  # the turn rate of the straight line is exactly zero
            F[:4, 6] = 0.0
        s = move(self.s, self.tau)
        P = F @ self.P @ F.T + self.Q
        H = np.zeros((2, 7))
        H[0, 0] = H[1, 2] = 1.0
        Sigma = H @ P @ H.T + np.diag(self.R)
        innovation = z - H @ s
        K = P @ H.T @ np.linalg.inv(Sigma)
        self.s, self.P = s + K @ innovation, P - K @ H @ P
        quadratic = innovation @ np.linalg.solve(Sigma, innovation)
        self.distance = quadratic
        self.log_likelihood -= 0.5 * (quadratic + math.log(np.linalg.det(2 * math.pi * Sigma)))
