"""A gate on measurements: one that no motion of a track explains is an error of the sensor, or a new track.

A single measurement far off would move the estimate by any distance, and its velocity with it. The filters of
turns are linearised there, and need not come back.
"""

import math

import numpy as np
from numpy.typing import NDArray

from hybrid_env.core.compilation import compiled, inlined

FloatArray = NDArray[np.float64]

DEVIATIONS = 10.0
"""Default distance from the nearest predicted position, in standard deviations, that is still accepted."""

PATIENCE = 5
"""Measurements outside of the gate, after which the track begins again: the object is elsewhere."""

LARGEST_TURN = 1.0  # angle in a tick [rad] above which a turn is no explanation of a measurement


@inlined
def _squared_distance(dx: float, dy: float, xx: float, xy: float, yy: float, allowed: float) -> float:
    """Return d' S^-1 d of a vector that is shorter by an allowed length."""
    length = math.hypot(dx, dy)
    left = max(length - allowed, 0.0) / max(length, 1e-300)
    return left * left * (yy * dx * dx - 2.0 * xy * dx * dy + xx * dy * dy) / (xx * yy - xy * xy)


@compiled
def gate_distance(
    measurement: FloatArray,
    estimate: FloatArray,
    covariance: FloatArray,
    radii: FloatArray,
    tau: float,
    variances: FloatArray,
    ticks: int,
) -> float:
    """Return the distance of a measurement from the nearest predicted position, in standard deviations.

    Predicted are straight motion and the turns of the bank, but no turn by a large angle in a tick.

    Args:
        measurement: (2,) [m].
        estimate: (4,) [x, vx, y, vy] one tick before [m, m/s].
        covariance: (4, 4) of the estimate.
        radii: (n,) [m].
        tau: length of a tick [s].
        variances: (2,) of the measurement [m^2].
        ticks: since the estimate was right for certain. What turns in the ticks before the last one can have
            added to the distance from a straight line does not count, unless they would be as large.
    """
    P = covariance
    xx = P[0, 0] + 2.0 * tau * P[0, 1] + tau * tau * P[1, 1] + variances[0]
    yy = P[2, 2] + 2.0 * tau * P[2, 3] + tau * tau * P[3, 3] + variances[1]
    xy = P[0, 2] + tau * (P[0, 3] + P[1, 2]) + tau * tau * P[1, 3]
    u, v = tau * estimate[1], tau * estimate[3]
    dx, dy = measurement[0] - estimate[0], measurement[1] - estimate[2]
    step, allowed = math.hypot(u, v), 0.0
    if ticks > 1 and step <= LARGEST_TURN * radii.min():
        path = step * ticks
        allowed = path * min(path / (2.0 * radii.min()), 2.0)
    nearest = _squared_distance(dx - u, dy - v, xx, xy, yy, allowed)
    for k in range(radii.size):
        angle = step / radii[k]
        if 0.0 < angle <= LARGEST_TURN:
            along, across = math.sin(angle) / angle, (1.0 - math.cos(angle)) / angle
            for side in (-1.0, 1.0):
                x, y = along * u - side * across * v, along * v + side * across * u
                nearest = min(nearest, _squared_distance(dx - x, dy - y, xx, xy, yy, allowed))
    return math.sqrt(nearest)
