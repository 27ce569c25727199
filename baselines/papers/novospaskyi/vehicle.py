"""The aircraft: limits, drag, and the guidance from waypoint to waypoint; the same for both flight models.

Novospaskyi 2025, section 2.1.2, flies a quadrotor through all waypoints and discards flights that fail. Its
vehicle is not described; the values here are those of a fast quadrotor that can turn at 50 m/s.
"""

import math

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

GRAVITY = 9.81
"""[m/s^2]."""

SPEED = 51.0
"""Commanded speed [m/s]; with the turns, the mean speed is 50 m/s, as in the thesis."""

LARGEST_FORCE = 2.5 * GRAVITY
"""Largest thrust per mass [m/s^2]."""

SMALLEST_FORCE = 0.2 * GRAVITY
"""Smallest upward thrust per mass that is commanded, so that the attitude can be controlled [m/s^2]."""

LARGEST_TILT = math.radians(60.0)
DRAG = 0.0016
"""Drag per mass over squared speed [1/m]: 4 m/s^2 at 50 m/s."""

FORCE_LAG = 0.2
"""Time constant of the point mass from commanded to actual thrust vector [s]; a quadrotor has to tilt."""

VELOCITY_GAIN = 1.2
"""Acceleration commanded for one metre per second of velocity error [1/s]."""

CAPTURE = 40.0
"""Distance at which a waypoint counts as passed [m]."""

TIME_LIMIT = 8.0
"""Longest time from one waypoint to the next [s]; a flight that takes longer has failed."""

RECORD_STEP = 0.05
"""Time between recorded states, and between commands of the guidance [s]."""


def drag(velocity: FloatArray) -> FloatArray:
    """Acceleration by drag, (..., 3) [m/s^2], at a velocity, (..., 3) [m/s]."""
    return -DRAG * np.linalg.norm(velocity, axis=-1, keepdims=True) * velocity


def thrust_command(position: FloatArray, velocity: FloatArray, target: FloatArray) -> FloatArray:
    """Thrust per mass that flies to a point at `SPEED`, within the limits.

    The height has priority: the vertical part is limited first, then the horizontal part.

    Args:
        position: (..., 3) [m].
        velocity: (..., 3) [m/s].
        target: (..., 3) point ahead [m].

    Returns:
        (..., 3) thrust per mass in world axes [m/s^2], its vertical part positive.
    """
    way = target - position
    distance = np.maximum(np.linalg.norm(way, axis=-1, keepdims=True), 1e-9)
    force = VELOCITY_GAIN * (SPEED * way / distance - velocity) - drag(velocity)
    force[..., 2] = np.clip(force[..., 2] + GRAVITY, SMALLEST_FORCE, 0.9 * LARGEST_FORCE)
    up = force[..., 2]
    allowed = np.minimum(math.tan(LARGEST_TILT) * up, np.sqrt(LARGEST_FORCE**2 - up**2))
    sideways = np.maximum(np.hypot(force[..., 0], force[..., 1]), 1e-9)
    force[..., :2] *= np.minimum(allowed / sideways, 1.0)[..., None]
    return force


class Guidance:
    """Progress of N vehicles along their waypoints.

    Args:
        waypoints: of each vehicle, (W, 3) [m] with its own W. The first one is the start.

    Attributes:
        flying: (N,) vehicles still on the way.
        succeeded: (N,) vehicles that have passed their last waypoint.
    """

    def __init__(self, waypoints: list[FloatArray]):
        self._counts = np.array([len(points) for points in waypoints])
        self._waypoints = np.zeros((len(waypoints), self._counts.max(), 3))
        for row, points in zip(self._waypoints, waypoints, strict=True):
            row[: len(points)] = points
            row[len(points) :] = points[-1]
        self._rows = np.arange(len(waypoints))
        self._next = np.ones(len(waypoints), dtype=np.int64)
        self._since = np.zeros(len(waypoints))
        self.flying = np.ones(len(waypoints), dtype=bool)
        self.succeeded = np.zeros(len(waypoints), dtype=bool)

    def start(self) -> tuple[FloatArray, FloatArray]:
        """Positions [m] and velocities [m/s] at the start, each (N, 3): in flight, along the curve."""
        way = self._waypoints[:, 1] - self._waypoints[:, 0]
        return self._waypoints[:, 0].copy(), SPEED * way / np.linalg.norm(way, axis=1, keepdims=True)

    def targets(self, position: FloatArray) -> FloatArray:
        """Next waypoints, (N, 3) [m], `RECORD_STEP` after the last call, at positions (N, 3) [m]."""
        target = self._waypoints[self._rows, self._next]
        passed = self.flying & (np.linalg.norm(target - position, axis=1) < CAPTURE)
        self._since = np.where(passed, 0.0, self._since + RECORD_STEP)
        self._next[passed] += 1
        self.succeeded |= self._next >= self._counts
        failed = (self._since > TIME_LIMIT) | (position[:, 2] <= 0.0)
        self.flying &= ~(self.succeeded | failed)
        self._next = np.minimum(self._next, self._counts - 1)
        return self._waypoints[self._rows, self._next]
