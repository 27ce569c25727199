"""What every simulator gives: a path with its modes, of something of which deciders are told a
little.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

CONTROL = 0.1
"""Time between two points of a path, and between two corrections of the controls [s]."""


class Path(NamedTuple):
    """A path at every correction of the controls.

    Attributes:
        states: (n, 4) true [x, vx, y, vy], x east and y north [m, m/s].
        modes: (n,) straight, left or right.
    """

    states: NDArray[np.float64]
    modes: NDArray[np.int64]


def flown_path(velocities: NDArray[np.float64], modes: NDArray[np.int64]) -> Path:
    """Return the path, which begins at 0, of velocities east and north (n, 2) [m/s]."""
    # Trapezoids.
    moved = CONTROL * (np.cumsum(velocities, axis=0) - 0.5 * (velocities + velocities[0]))
    return Path(np.stack([moved, velocities], axis=2).reshape(-1, 4), modes)
