"""Flights: random curves, the limits, drag and guidance of the aircraft, and a point mass that
flies them. Novospaskyi 2025, sections 2.1.1 (curves and waypoints) and 2.1.2 (a quadrotor flies
through all waypoints, and failed flights are discarded). The vehicle is not described; the values
are those of a fast quadrotor that can turn at 50 m/s.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

FloatArray = NDArray[np.float64]

# Number of flights of the thesis.
FLIGHTS = 133
# Bounds of the control points on each axis [m]; the thesis states 5 km x 5 km and at most 400 m
# height.
SPACE = ((0.0, 5000.0), (0.0, 5000.0), (50.0, 400.0))
# Of a curve: cubic curves.
CONTROL_POINTS = 4
# Distance between waypoints on the curve [m].
SPACING = 100.0
# Length of the shortest curve that is flown [m], half a minute of flight.
SHORTEST = 1500.0
# [m/s^2]
GRAVITY = 9.81
# Commanded speed [m/s]; with the turns, the mean speed is 50 m/s, as in the thesis.
SPEED = 51.0
# Largest thrust per mass [m/s^2].
LARGEST_FORCE = 2.5 * GRAVITY
# Smallest upward thrust per mass that is commanded, so that the attitude can be controlled [m/s^2].
SMALLEST_FORCE = 0.2 * GRAVITY
LARGEST_TILT = math.radians(60.0)
# Drag per mass over squared speed [1/m]: 4 m/s^2 at 50 m/s.
DRAG = 0.0016
# Time constant of the point mass from commanded to actual thrust vector [s]; a quadrotor has to
# tilt.
FORCE_LAG = 0.2
# Acceleration commanded for one metre per second of velocity error [1/s].
VELOCITY_GAIN = 1.2
# Distance at which a waypoint counts as passed [m].
CAPTURE = 40.0
# Longest time from one waypoint to the next [s]; a flight that takes longer has failed.
TIME_LIMIT = 8.0
# Time between recorded states, and between commands of the guidance [s].
RECORD_STEP = 0.05
# Attempts of flights at once.
BATCH = 32
# Of a curve, for its length.
_SAMPLES = 1001


def bezier(control_points: FloatArray, parameters: FloatArray) -> FloatArray:
    """Points (S, 3) of a Bezier curve, from its control points (C, 3) and parameters in [0, 1],
    (S,).
    """
    degree = len(control_points) - 1
    shares = parameters[:, None]
    index = np.arange(degree + 1)
    weights = np.array([math.comb(degree, k) for k in index], dtype=np.float64)
    return (weights * shares**index * (1.0 - shares) ** (degree - index)) @ control_points


def flight_route(seed: int, attempt: int) -> FloatArray:
    """Waypoints (W, 3) [m] of an attempt, on a random curve in `SPACE` of at least `SHORTEST`,
    its ends included.
    """
    generator = np.random.default_rng((seed, 0, attempt))
    low, high = np.array(SPACE).T
    while True:
        curve = bezier(
            generator.uniform(low, high, (CONTROL_POINTS, 3)),
            np.linspace(0.0, 1.0, _SAMPLES),
        )
        length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))])
        if length[-1] >= SHORTEST:
            break
    wanted = np.linspace(
        0.0,
        length[-1],
        int(length[-1] // SPACING) + 1,
    )
    return np.stack([np.interp(wanted, length, curve[:, axis]) for axis in range(3)], axis=-1)


def drag(velocity: FloatArray) -> FloatArray:
    """Acceleration by drag, (..., 3) [m/s^2], at a velocity, (..., 3) [m/s]."""
    return -DRAG * np.linalg.norm(velocity, axis=-1, keepdims=True) * velocity


def thrust_command(
    position: FloatArray,
    velocity: FloatArray,
    target: FloatArray,
) -> FloatArray:
    """Thrust per mass [m/s^2] that flies from a position to a target at `SPEED`, within the limits,
    all (..., 3): the vertical part is limited first, then the horizontal one.
    """
    way = target - position
    distance = np.maximum(np.linalg.norm(way, axis=-1, keepdims=True), 1e-9)
    force = VELOCITY_GAIN * (SPEED * way / distance - velocity) - drag(velocity)
    force[..., 2] = np.clip(
        force[..., 2] + GRAVITY,
        SMALLEST_FORCE,
        0.9 * LARGEST_FORCE,
    )
    up = force[..., 2]
    allowed = np.minimum(math.tan(LARGEST_TILT) * up, np.sqrt(LARGEST_FORCE**2 - up**2))
    sideways = np.maximum(np.hypot(force[..., 0], force[..., 1]), 1e-9)
    force[..., :2] *= np.minimum(allowed / sideways, 1.0)[..., None]
    return force


class Guidance:
    """Progress of N vehicles along their waypoints, (W, 3) [m] each with its own W; the first one
    is the start. `flying` and `succeeded`, (N,), are those still on the way, and those that have
    passed their last waypoint.
    """

    def __init__(self, waypoints: list[FloatArray]):
        self._counts = np.array([len(points) for points in waypoints])
        longest = self._counts.max()
        padded = [
            np.pad(
                points,
                (
                    (0, longest - len(points)),
                    (0, 0),
                ),
                mode="edge",
            )
            for points in waypoints
        ]
        self._waypoints = np.stack(padded)
        self._rows = np.arange(len(waypoints))
        self._next = np.ones(len(waypoints), dtype=np.int64)
        self._since = np.zeros(len(waypoints))
        self.flying = np.ones(len(waypoints), dtype=bool)
        self.succeeded = np.zeros(len(waypoints), dtype=bool)

    def start(self) -> tuple[FloatArray, FloatArray]:
        """Positions [m] and velocities [m/s] at the start, each (N, 3): in flight, along the
        curve.
        """
        way = self._waypoints[:, 1] - self._waypoints[:, 0]
        return self._waypoints[:, 0].copy(), SPEED * way / np.linalg.norm(
            way,
            axis=1,
            keepdims=True,
        )

    def targets(self, position: FloatArray) -> FloatArray:
        """Next waypoints, (N, 3) [m], `RECORD_STEP` after the last call, at positions (N, 3)
        [m].
        """
        target = self._waypoints[self._rows, self._next]
        passed = self.flying & (np.linalg.norm(target - position, axis=1) < CAPTURE)
        self._since = np.where(
            passed,
            0.0,
            self._since + RECORD_STEP,
        )
        self._next[passed] += 1
        self.succeeded |= self._next >= self._counts
        failed = (self._since > TIME_LIMIT) | (position[:, 2] <= 0.0)
        self.flying &= ~(self.succeeded | failed)
        self._next = np.minimum(self._next, self._counts - 1)
        return self._waypoints[self._rows, self._next]


@dataclass(frozen=True)
class Flight:
    """States every `RECORD_STEP` seconds from time 0."""

    # (T, 3) [m]
    positions: FloatArray
    # (T, 3) [m/s]
    velocities: FloatArray

    @property
    def times(self) -> FloatArray:
        """Times of the states, (T,) [s]."""
        return np.asarray(RECORD_STEP * np.arange(len(self.positions)), np.float64)

    def states_at(self, times: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Positions [m] and velocities [m/s], each (K, 3), at times within the flight, (K,) [s]."""
        curve = CubicHermiteSpline(self.times, self.positions, self.velocities)
        return np.asarray(curve(times), np.float64), np.asarray(curve(times, 1), np.float64)


def fly_point_masses(routes: list[FloatArray]) -> list[Flight | None]:
    """Flights through the waypoints of every route, None where one failed, by the midpoint rule."""
    guidance = Guidance(routes)
    position, velocity = guidance.start()
    step = RECORD_STEP
    share = 1.0 - np.exp(-step / FORCE_LAG)
    gravity = np.array([0.0, 0.0, -GRAVITY])
    # In equilibrium.
    force = -gravity - drag(velocity)
    positions = [position]
    velocities = [velocity]
    lengths = np.ones(len(routes), dtype=np.int64)
    while True:
        command = thrust_command(position, velocity, guidance.targets(position))
        if not guidance.flying.any():
            break
        force = force + share * (command - force)
        middle = velocity + 0.5 * step * (force + gravity + drag(velocity))
        position = position + step * middle
        velocity = velocity + step * (force + gravity + drag(middle))
        positions.append(position)
        velocities.append(velocity)
        lengths += guidance.flying
    flown = np.stack(positions, axis=1)
    speeds = np.stack(velocities, axis=1)
    return [
        Flight(flown[index, :length].copy(), speeds[index, :length].copy()) if succeeded else None
        for index, (length, succeeded) in enumerate(zip(lengths, guidance.succeeded, strict=True))
    ]


def point_mass_flights(count: int, seed: int) -> list[Flight]:
    """The first successful flights of the attempts 0, 1, 2 ... of point masses."""
    flown: list[Flight] = []
    attempt = 0
    while len(flown) < count:
        routes = [flight_route(seed, number) for number in range(attempt, attempt + BATCH)]
        flown += [flight for flight in fly_point_masses(routes) if flight is not None]
        attempt += BATCH
    return flown[:count]
