"""Banks written without this package: one 4x4 filter per hypothesis, in NumPy and with filterpy."""

import importlib.util
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baselines.papers.golubkov2018 import START

TAU, Q, R = 0.1, 0.001, 0.1
H = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])
GQG = Q * np.diag([0.0, 1.0, 0.0, 1.0])


def has_filterpy() -> bool:
    """Whether filterpy is installed; an optional dependency for development."""
    return importlib.util.find_spec("filterpy") is not None


def transitions(radii: tuple[float, ...]) -> list[tuple[NDArray[Any], NDArray[Any]]]:
    """Phi (4, 4) and B (4,) of every hypothesis, anchored at the start of Golubkov 2018, eq. (1)."""
    x, vx, y, vy = START
    made = [(np.kron(np.eye(2), [[1.0, TAU], [0.0, 1.0]]), np.zeros(4))]
    for signed in (*radii, *(-radius for radius in radii)):
        rate = math.hypot(vx, vy) / abs(signed)
        cosine, sine = math.cos(rate * TAU), math.sin(rate * TAU)
        Phi = np.kron(np.eye(2), [[cosine, sine / rate], [-rate * sine, cosine]])
        side = math.copysign(1.0, signed)
        centre = np.array([x - side * vy / rate, 0.0, y + side * vx / rate, 0.0])
        made.append((Phi, centre - Phi @ centre))
    return made


class NumpyBank:
    """Golubkov 2018, eq. (2), in matrices."""

    def __init__(self, radii: tuple[float, ...]):
        self.filters = [[np.array(START), np.eye(4), Phi, B] for Phi, B in transitions(radii)]
        self.log_likelihood = np.zeros(len(self.filters))

    def step(self, z: NDArray[np.float64]) -> None:
        """One tick. z: (2,) [m]."""
        for index, one in enumerate(self.filters):
            x, P, Phi, B = one
            x = Phi @ x + B
            P = Phi @ P @ Phi.T + GQG
            innovation = z - H @ x
            Sigma = H @ P @ H.T + R * np.eye(2)
            inverse = np.linalg.inv(Sigma)
            K = P @ H.T @ inverse
            one[0], one[1] = x + K @ innovation, P - K @ H @ P
            quadratic = innovation @ inverse @ innovation
            self.log_likelihood[index] -= 0.5 * (quadratic + math.log(np.linalg.det(2 * math.pi * Sigma)))


class FilterpyBank:
    """The same with filterpy's KalmanFilter."""

    def __init__(self, radii: tuple[float, ...]):
        from filterpy.kalman import KalmanFilter

        self.filters: list[Any] = []
        for Phi, B in transitions(radii):
            one = KalmanFilter(dim_x=4, dim_z=2, dim_u=1)
            one.x, one.F, one.H, one.Q, one.R = np.array(START), Phi, H, GQG, R * np.eye(2)
            one.B = B
            self.filters.append(one)
        self.log_likelihood = np.zeros(len(self.filters))

    def step(self, z: NDArray[np.float64]) -> None:
        """One tick. z: (2,) [m]."""
        for index, one in enumerate(self.filters):
            one.predict(1.0)
            one.update(z)
            self.log_likelihood[index] += one.log_likelihood
