"""Motion models for real time steps: constant velocity, acceleration and jerk (CV, CA, CJ).

The state lists position and derivatives axis by axis, [x, vx, y, vy] for CV in the plane: n = d m
values. The axes are independent, with the same m x m transition matrix. White noise drives the
highest derivative. Bar-Shalom, Li & Kirubarajan 2001, "Estimation with Applications to Tracking and
Navigation", section 6.2 (continuous noise) and 6.3 (discrete noise).
"""

from dataclasses import dataclass
from itertools import combinations_with_replacement
from math import factorial
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from studies.arrays import FloatArray


@dataclass(frozen=True)
class MotionModel:
    """A kinematic model of d axes and its process noise.

    The intensity of the noise is one number or (d,). Continuous noise, which does not depend on how
    a time is divided into steps, has the spectral density of the white noise that drives the
    highest derivative: [m^2/s^3] for CV, [m^2/s^5] for CA, [m^2/s^7] for CJ. Discrete noise has the
    variance of the acceleration that is constant in a time step for CV [m^2/s^4], and of the
    increment of the highest derivative in it for CA [m^2/s^4] and CJ [m^2/s^6].
    """

    name: Literal["CV", "CA", "CJ"]
    axes: int
    noise: float | ArrayLike
    discretization: Literal["continuous", "discrete"] = "continuous"

    def __post_init__(self) -> None:
        noise = np.broadcast_to(np.asarray(self.noise, float), self.axes)
        object.__setattr__(self, "noise", noise)

    @property
    def order(self) -> int:
        """Number of values per axis, m."""
        return {"CV": 2, "CA": 3, "CJ": 4}[self.name]

    @property
    def size(self) -> int:
        """Number of values of the state, n = d m."""
        return self.axes * self.order

    def matrices(self, dt: float | FloatArray) -> tuple[FloatArray, FloatArray]:
        """Transition matrix F and covariance Q of the process noise of the whole state, (n, n) or
        (B, n, n), for a time step [s] or (B,) of them.
        """
        transition = np.kron(np.eye(self.axes), self.transition(dt))
        noise = np.kron(np.diag(np.asarray(self.noise)), self.step_noise(dt))
        return np.asarray(transition, np.float64), np.asarray(noise, np.float64)

    def transition(self, dt: float | FloatArray) -> FloatArray:
        """Transition matrix of one axis, (m, m) or (B, m, m), for a time step [s] or (B,) of
        them.
        """
        steps = np.asarray(dt, float)
        matrix = np.zeros((*steps.shape, self.order, self.order))
        for row, column in combinations_with_replacement(range(self.order), 2):
            matrix[..., row, column] = steps ** (column - row) / factorial(column - row)
        return matrix

    def step_noise(self, dt: float | FloatArray) -> FloatArray:
        """Covariance of the process noise of one axis for unit intensity, (m, m) or (B, m, m)."""
        steps = np.asarray(dt, float)
        m = self.order
        if self.discretization == "discrete":
            # CV: an acceleration for the whole step; CA and CJ: a jump of the last value at its
            # beginning.
            powers = [2, 1] if self.name == "CV" else list(range(m - 1, -1, -1))
            effect = np.stack([steps**power / factorial(power) for power in powers], axis=-1)
            # No time, no noise.
            moved = (steps > 0.0)[..., None, None]
            return effect[..., :, None] * effect[..., None, :] * moved
        matrix = np.zeros((*steps.shape, m, m))
        for row, column in np.ndindex(m, m):
            power = 2 * m - 1 - row - column
            matrix[..., row, column] = steps**power / (
                power * factorial(m - 1 - row) * factorial(m - 1 - column)
            )
        return matrix
