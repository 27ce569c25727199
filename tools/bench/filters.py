"""Speed of a bank's step against filterpy, with a 4x4 filter for each hypothesis."""

import importlib.util
import math
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_env import KalmanBank
from tools.bench.environments import BANKS
from tools.bench.timing import Measurement, measure_in_turn, speed_ratio

TAU, Q, R = 0.1, 0.001, 0.1
# State [x, vx, y, vy] one tick before the first measurement, of Golubkov 2018.
START = (0.0, 0.0, 0.0, 2.0)
H = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])
GQG = Q * np.diag([0.0, 1.0, 0.0, 1.0])


def bank_step() -> Iterator[Measurement]:
    """One tick of a bank against filterpy's KalmanFilter."""
    measurement = np.array([0.1, 0.2])
    for name, radii in BANKS.items() if has_filterpy() else ():
        bank = KalmanBank(radii)
        peer = FilterpyBank(radii)
        bank.anchor(START)
        times = measure_in_turn(partial(bank.step, measurement), partial(peer.step, measurement))
        yield speed_ratio("bank step", f"{name}, against filterpy", *times)


def has_filterpy() -> bool:
    """Whether filterpy is installed; an optional dependency for development."""
    return importlib.util.find_spec("filterpy") is not None


def transitions(radii: tuple[float, ...]) -> list[tuple[NDArray[Any], NDArray[Any]]]:
    """Phi (4, 4) and B (4,) of every hypothesis, anchored at the start of Golubkov 2018, eq.
    (1).
    """
    x, vx, y, vy = START
    made = [(np.kron(np.eye(2), [[1.0, TAU], [0.0, 1.0]]), np.zeros(4))]
    for signed in (*radii, *(-radius for radius in radii)):
        rate = math.hypot(vx, vy) / abs(signed)
        cosine = math.cos(rate * TAU)
        sine = math.sin(rate * TAU)
        Phi = np.kron(np.eye(2), [[cosine, sine / rate], [-rate * sine, cosine]])
        side = math.copysign(1.0, signed)
        centre = np.array([x - side * vy / rate, 0.0, y + side * vx / rate, 0.0])
        made.append((Phi, centre - Phi @ centre))
    return made


class FilterpyBank:
    """Golubkov 2018, eq. (2), with filterpy's KalmanFilter."""

    def __init__(self, radii: tuple[float, ...]):
        from filterpy.kalman import KalmanFilter

        self.filters: list[Any] = []
        for Phi, B in transitions(radii):
            one = KalmanFilter(dim_x=4, dim_z=2, dim_u=1)
            one.x, one.F, one.H, one.Q, one.R = (np.array(START), Phi, H, GQG, R * np.eye(2))
            one.B = B
            self.filters.append(one)
        self.log_likelihood = np.zeros(len(self.filters))

    def step(self, z: NDArray[np.float64]) -> None:
        """One tick. z: (2,) [m]."""
        for index, one in enumerate(self.filters):
            one.predict(1.0)
            one.update(z)
            self.log_likelihood[index] += one.log_likelihood
