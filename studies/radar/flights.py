"""Flights: random curves, the limits, drag and guidance of the aircraft, and a point mass that
flies them. Novospaskyi 2025, sections 2.1.1 (curves and waypoints) and 2.1.2 (a quadrotor flies
through all waypoints, and failed flights are discarded). The vehicle is not described; the values
are those of a fast quadrotor that can turn at 50 m/s.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from studies.arrays import FloatArray

# Number of flights of the thesis.
FLIGHTS = 133
# [m/s^2]
GRAVITY = 9.81
# Commanded speed [m/s]; with the turns, the mean speed is 50 m/s, as in the thesis.
SPEED = 51.0
# Largest thrust per mass [m/s^2].
LARGEST_FORCE = 2.5 * GRAVITY
# Time between recorded states, and between commands of the guidance [s].
RECORD_STEP = 0.05


def bezier(control_points: FloatArray, parameters: FloatArray) -> FloatArray:
    """Points (S, 3) of a Bezier curve, from its control points (C, 3) and parameters in [0, 1],
    (S,).
    """
    degree = len(control_points) - 1
    shares = parameters[:, None]
    index = np.arange(degree + 1)
    weights = np.array([math.comb(degree, k) for k in index], dtype=np.float64)
    return (weights * shares**index * (1.0 - shares) ** (degree - index)) @ control_points


def flight_route(
    seed: int,
    attempt: int,
    low: Sequence[float] = (0.0, 0.0, 50.0),
    high: Sequence[float] = (5000.0, 5000.0, 400.0),
    shortest: float = 1500.0,
    spacing: float = 100.0,
) -> FloatArray:
    """Waypoints (W, 3) [m] of an attempt, its ends included, on a random cubic curve of at least
    half a minute of flight.

    Args:
        seed, attempt: of the random numbers.
        low, high: (3,) bounds of the control points [m]; the thesis states 5 km x 5 km and at most
            400 m height.
        shortest: length of the shortest curve that is flown [m].
        spacing: distance between waypoints on the curve [m].
    """
    generator = np.random.default_rng((seed, 0, attempt))
    while True:
        curve = bezier(generator.uniform(low, high, (4, 3)), np.linspace(0.0, 1.0, 1001))
        length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))])
        if length[-1] >= shortest:
            break
    wanted = np.linspace(0.0, length[-1], int(length[-1] // spacing) + 1)
    return np.stack([np.interp(wanted, length, curve[:, axis]) for axis in range(3)], axis=-1)


def drag(velocity: FloatArray, factor: float = 0.0016) -> FloatArray:
    """Acceleration by drag, (..., 3) [m/s^2], at a velocity, (..., 3) [m/s]. `factor`: drag per
    mass over squared speed [1/m], 4 m/s^2 at 50 m/s.
    """
    return -factor * np.linalg.norm(velocity, axis=-1, keepdims=True) * velocity


def thrust_command(
    position: FloatArray,
    velocity: FloatArray,
    target: FloatArray,
    gain: float = 1.2,
    smallest_force: float = 0.2 * GRAVITY,
    largest_tilt: float = math.radians(60.0),
) -> FloatArray:
    """Thrust per mass [m/s^2] that flies from a position to a target at `SPEED`, within the limits,
    all (..., 3): the vertical part is limited first, then the horizontal one.

    Args:
        position, velocity, target: (..., 3) [m, m/s].
        gain: acceleration for one metre per second of velocity error [1/s].
        smallest_force: smallest upward thrust per mass, so that the attitude can be controlled
            [m/s^2].
        largest_tilt: of the thrust [rad].
    """
    way = target - position
    distance = np.maximum(np.linalg.norm(way, axis=-1, keepdims=True), 1e-9)
    force = gain * (SPEED * way / distance - velocity) - drag(velocity)
    force[..., 2] = np.clip(force[..., 2] + GRAVITY, smallest_force, 0.9 * LARGEST_FORCE)
    up = force[..., 2]
    allowed = np.minimum(math.tan(largest_tilt) * up, np.sqrt(LARGEST_FORCE**2 - up**2))
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
            np.pad(points, ((0, longest - len(points)), (0, 0)), mode="edge")
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
        velocity = SPEED * way / np.linalg.norm(way, axis=1, keepdims=True)
        return self._waypoints[:, 0].copy(), velocity

    def targets(
        self, position: FloatArray, capture: float = 40.0, time_limit: float = 8.0
    ) -> FloatArray:
        """Next waypoints, (N, 3) [m], `RECORD_STEP` after the last call, at positions (N, 3) [m].
        Within the distance `capture` [m] a waypoint counts as passed; a flight that takes longer
        than the limit [s] from one to the next has failed.
        """
        target = self._waypoints[self._rows, self._next]
        passed = self.flying & (np.linalg.norm(target - position, axis=1) < capture)
        self._since = np.where(passed, 0.0, self._since + RECORD_STEP)
        self._next[passed] += 1
        self.succeeded |= self._next >= self._counts
        failed = (self._since > time_limit) | (position[:, 2] <= 0.0)
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


def fly_point_masses(routes: list[FloatArray], lag: float = 0.2) -> list[Flight | None]:
    """Flights through the waypoints of every route, None where one failed, by the midpoint rule.
    `lag`: time constant from commanded to actual thrust [s]; a quadrotor has to tilt.
    """
    guidance = Guidance(routes)
    position, velocity = guidance.start()
    step = RECORD_STEP
    share = 1.0 - np.exp(-step / lag)
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


def point_mass_flights(count: int, seed: int, batch: int = 32) -> list[Flight]:
    """The first successful flights of the attempts 0, 1, 2 ... of point masses, `batch` at once."""
    flown: list[Flight] = []
    attempt = 0
    while len(flown) < count:
        routes = [flight_route(seed, number) for number in range(attempt, attempt + batch)]
        flown += [flight for flight in fly_point_masses(routes) if flight is not None]
        attempt += batch
    return flown[:count]
