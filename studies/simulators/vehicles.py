"""What every simulator gives: paths with their modes, of something of which deciders are told a
little.
"""

import functools
from abc import ABC, abstractmethod
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

IntArray = NDArray[np.int64]
FloatArray = NDArray[np.float64]

CONTROL = 0.1
"""Time between two points of a path, and between two corrections of the controls [s]."""


class Path(NamedTuple):
    """A path at every correction of the controls.

    Attributes:
        states: (n, 4) true [x, vx, y, vy], x east and y north [m, m/s].
        modes: (n,) straight, left or right.
    """

    states: FloatArray
    modes: IntArray


class Vehicle(ABC):
    """A kind of what moves in a simulator.

    Attributes:
        simulator: its name; in lower case that of its Python module.
        block_size: number of vehicles that are simulated at the same time, with successive seeds.
        speed: median [m/s].
        radius: median in turns [m].
        lasting: durations of modes: the least one, and the mean of what is exponential beyond it
            [s].
        ticks: lengths of a tick [s].
        noises: standard deviations of a measured position [m].
    """

    simulator: ClassVar[str]
    block_size: ClassVar[int] = 20
    speed: float
    radius: float
    lasting: tuple[float, float]
    ticks: tuple[float, ...]
    noises: tuple[float, ...]

    @abstractmethod
    def paths(self, block: int, duration: float) -> list[Path]:
        """Return the paths of a duration [s] of the vehicles that are simulated at the same time;
        everything random follows from the number of their block.
        """

    def travel(self, seed: int, duration: float) -> Path:
        """Return the path of a duration [s] that follows from a seed."""
        return _paths(self, seed // self.block_size, duration)[seed % self.block_size]


# A simulator takes a second for a path, which the nine worlds of a kind share.
@functools.lru_cache(128)
def _paths(vehicle: Vehicle, block: int, duration: float) -> list[Path]:
    return vehicle.paths(block, duration)


def flown_path(velocities: FloatArray, modes: IntArray) -> Path:
    """Return the path, which begins at 0, of velocities east and north (n, 2) [m/s]."""
    # Trapezoids.
    moved = CONTROL * (np.cumsum(velocities, axis=0) - 0.5 * (velocities + velocities[0]))
    return Path(np.stack([moved, velocities], axis=2).reshape(-1, 4), modes)
