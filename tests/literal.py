"""The oracle: filters written out in 4x4 matrices, as the papers print them."""

import math

import numpy as np


class LiteralFilter:
    """One filter in 4x4 matrices: Golubkov 2018, eq. (1), (2), with Sigma = H P H' + R."""

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
