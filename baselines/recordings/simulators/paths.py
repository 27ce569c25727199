"""What every simulator gives: a path with its modes, of something of which deciders are told a little."""

from typing import NamedTuple, Protocol

import numpy as np

from hybrid_env.checks import FloatArray, IntArray

CONTROL = 0.1
"""Time between two points of a path, and between two corrections of the controls [s]."""


class Path(NamedTuple):
    """A path at every correction of the controls.

    Attributes:
        states: (n, 4) true [x, vx, y, vy], x east and y north [m, m/s].
        modes: (n,) straight, left or right.
        banks: (n,) flown bank, positive to the right [deg]; of aircraft only whose bank takes time.
    """

    states: FloatArray
    modes: IntArray
    banks: FloatArray | None = None


class Vehicle(Protocol):
    """An entry of the table of what moves in a simulator."""

    @property
    def simulator(self) -> str:
        """Name of the simulator, in titles."""

    @property
    def module(self) -> str:
        """Python module of the simulator."""

    @property
    def speed(self) -> float:
        """Nominal speed [m/s]."""

    @property
    def radius(self) -> float:
        """Nominal radius of a turn [m]."""

    @property
    def lasting(self) -> tuple[float, float]:
        """Durations of modes: the least one, and the mean of what is exponential beyond it [s]."""

    @property
    def ticks(self) -> tuple[float, ...]:
        """Lengths of a tick [s]."""

    @property
    def noises(self) -> tuple[float, ...]:
        """Standard deviations of a measured position [m]."""

    def travel(self, seed: int, duration: float) -> Path:
        """Return the path of a seed and of a duration [s]."""


def flown_path(velocities: FloatArray, modes: IntArray, banks: FloatArray | None = None) -> Path:
    """Return the path, which begins at 0, of velocities east and north (n, 2) [m/s]."""
    moved = CONTROL * (np.cumsum(velocities, axis=0) - 0.5 * (velocities + velocities[0]))  # trapezoids
    return Path(np.stack([moved, velocities], axis=2).reshape(-1, 4), modes, banks)
