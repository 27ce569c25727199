"""Bezier curves through the air space, and the waypoints that a vehicle flies through.

Novospaskyi 2025, section 2.1.1: a random Bezier curve, with waypoints evenly spaced on it.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

SPACE = ((0.0, 5000.0), (0.0, 5000.0), (50.0, 400.0))
"""Bounds of the control points on each axis [m]; the thesis states 5 km x 5 km and at most 400 m height."""

CONTROL_POINTS = 4
"""Of a curve: cubic curves."""
SPACING = 100.0
"""Distance between waypoints on the curve [m]."""

SHORTEST = 1500.0
"""Length of the shortest curve that is flown [m], half a minute of flight."""

_SAMPLES = 1001  # of a curve, for its length


@dataclass(frozen=True)
class Path:
    """Task of one flight.

    Attributes:
        control_points: (C, 3) control points of the Bezier curve [m].
        waypoints: (W, 3) points on the curve, the first and the last included [m].
    """

    control_points: FloatArray
    waypoints: FloatArray


def bezier(control_points: FloatArray, parameters: FloatArray) -> FloatArray:
    """Points of a Bezier curve, (S, 3), from its control points (C, 3) and parameters in [0, 1], (S,)."""
    degree = len(control_points) - 1
    index = np.arange(degree + 1)
    weights = np.array([math.comb(degree, int(k)) for k in index], dtype=np.float64)
    shares = parameters[:, None]
    return (weights * shares**index * (1.0 - shares) ** (degree - index)) @ control_points


def random_path(generator: np.random.Generator) -> Path:
    """A random curve in `SPACE`, with control points uniform on each axis, at least `SHORTEST` long.

    Args:
        generator: source of random numbers.
    """
    low, high = np.array(SPACE).T
    while True:
        control_points = generator.uniform(low, high, (CONTROL_POINTS, 3))
        curve = bezier(control_points, np.linspace(0.0, 1.0, _SAMPLES))
        length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))])
        if length[-1] >= SHORTEST:
            break
    wanted = np.linspace(0.0, length[-1], int(length[-1] // SPACING) + 1)
    waypoints = np.stack([np.interp(wanted, length, curve[:, axis]) for axis in range(3)], axis=-1)
    return Path(control_points, waypoints)
