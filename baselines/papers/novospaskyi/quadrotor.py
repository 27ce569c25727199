"""Flights of a quadrotor in the physics engine PyBullet (extra `physics`).

A rigid body with six degrees of freedom, four rotor forces with motor lag, and drag. The guidance is that
of the point mass; its thrust command is followed by a geometric attitude controller, Lee, Leok & McClamroch
2010, "Geometric tracking control of a quadrotor UAV on SE(3)". PyBullet contains no quadrotor, so the body
is built here. A flight takes some seconds, so that each is stored in a file; a killed run continues with
the next one.
"""

import math
import os
import secrets
import zipfile
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from baselines.papers.novospaskyi import flights
from baselines.papers.novospaskyi.flights import Flight, Route, flight_route
from hybrid_env.checks import ArgumentError, FloatArray

RATE = 120
"""Steps of the controller and of the engine per second."""

MASS = 1.5
"""[kg]."""

HALF_SIZE = (0.2, 0.2, 0.05)
"""Half of the body's size on each axis, for its inertia [m]."""

ARM = 0.2
"""Distance of the rotors from the centre along each horizontal body axis [m]; the rotors form a cross (x)."""

TORQUE_SHARE = 0.02
"""Yaw torque of a rotor over its force [m]."""

MOTOR_LAG = 0.03
"""Time constant from commanded to actual rotor force [s]."""

LARGEST_ROTOR_FORCE = flights.LARGEST_FORCE * MASS / 4.0 * 1.2
"""[N]; a fifth above the largest thrust of the guidance, so that torque remains available."""

ATTITUDE_GAIN = 120.0
"""Angular acceleration for an attitude error of one [1/s^2]."""

RATE_GAIN = 20.0
"""Angular acceleration for a rate error of one [1/s]."""

ROTORS = ARM * np.array([[1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0]])
"""Positions of the rotors in body axes, (4, 3) [m]."""

SPIN = np.array([1.0, -1.0, 1.0, -1.0])
"""Sign of each rotor's yaw torque."""

INERTIA = MASS / 3.0 * (np.dot(HALF_SIZE, HALF_SIZE) - np.square(HALF_SIZE))
"""Moments of inertia of a cuboid [kg m^2]."""

_ROTOR_LISTS = ROTORS.tolist()
_MIXER = np.linalg.inv(np.stack([np.ones(4), ROTORS[:, 1], -ROTORS[:, 0], TORQUE_SHARE * SPIN]))


class Engine:
    """A simulation of its own in PyBullet: the functions and constants of the module `pybullet`.

    Raises:
        ArgumentError: the extra `physics` is not installed.
    """

    def __init__(self) -> None:
        try:
            import pybullet
        except ImportError:
            raise ArgumentError(
                "flights with physics need PyBullet, which is not installed: "
                "pip install 'hybrid-track[physics]'"
            ) from None
        self._module = pybullet
        self._client = pybullet.connect(pybullet.DIRECT)

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._module, name)
        return partial(found, physicsClientId=self._client) if callable(found) else found


def _cross(first: FloatArray, second: FloatArray) -> FloatArray:
    """Cross product of two vectors, (3,); much faster for one pair than `numpy.cross`."""
    a, b, c = first.tolist()
    d, e, f = second.tolist()
    return np.array([b * f - c * e, c * d - a * f, a * e - b * d])


def desired_attitude(thrust: FloatArray) -> FloatArray:
    """Attitude, (3, 3), with the third body axis along a thrust, (3,), and the first one towards world x."""
    third = thrust / math.sqrt(thrust @ thrust)
    second = _cross(third, np.array([1.0, 0.0, 0.0]))
    second /= math.sqrt(second @ second)
    return np.stack([_cross(second, third), second, third], axis=1)


def rotor_commands(
    rotation: FloatArray, rates: FloatArray, desired: FloatArray, thrust: FloatArray
) -> FloatArray:
    """Forces of the four rotors, (4,) [N].

    Args:
        rotation: (3, 3) attitude, from body to world axes.
        rates: (3,) angular velocity in body axes [rad/s].
        desired: (3, 3) `desired_attitude` of the thrust.
        thrust: (3,) commanded thrust per mass in world axes [m/s^2].
    """
    skew = 0.5 * (desired.T @ rotation - rotation.T @ desired)  # Lee et al. 2010, eq. (10)
    error = np.array([skew[2, 1], skew[0, 2], skew[1, 0]])
    torque = INERTIA * (-ATTITUDE_GAIN * error - RATE_GAIN * rates) + _cross(rates, INERTIA * rates)
    force = MASS * max(float(thrust @ rotation[:, 2]), 0.0)
    return np.minimum(np.maximum(_MIXER @ np.array([force, *torque]), 0.0), LARGEST_ROTOR_FORCE)


def fly_quadrotor(route: Route) -> Flight | None:
    """Fly a quadrotor through the waypoints of a route.

    Args:
        route: task of the flight.

    Returns:
        The flight, or None if it failed: a waypoint was not reached in time, or the quadrotor fell.

    Raises:
        ArgumentError: the extra `physics` is not installed.
    """
    engine = Engine()
    try:
        return _fly(engine, route)
    finally:
        engine.disconnect()


def _fly(engine: Engine, route: Route) -> Flight | None:
    guidance = flights.Guidance([route.waypoints])
    start, start_velocity = guidance.start()
    quadrotor = Quadrotor(engine, start[0], start_velocity[0])
    share = 1.0 - math.exp(-1.0 / (RATE * MOTOR_LAG))
    steps = round(RATE * flights.RECORD_STEP)
    positions, velocities = [start[0]], [start_velocity[0]]
    while True:
        target = guidance.targets(positions[-1][None])[0]
        if not guidance.flying[0]:
            break
        thrust = flights.thrust_command(positions[-1], velocities[-1], target)
        desired = desired_attitude(thrust)
        for _ in range(steps):
            command = rotor_commands(quadrotor.rotation, quadrotor.rates, desired, thrust)
            quadrotor.forces += share * (command - quadrotor.forces)
            quadrotor.step()
        positions.append(quadrotor.position)
        velocities.append(quadrotor.velocity)
    if not guidance.succeeded[0]:
        return None
    return Flight(np.stack(positions), np.stack(velocities))


class Quadrotor:
    """The body in the engine, with four rotors and drag.

    Args:
        engine: the simulation.
        position: (3,) at the start [m].
        velocity: (3,) at the start [m/s]; the attitude is that of steady flight at this velocity.

    Attributes:
        position: (3,) [m].
        velocity: (3,) [m/s].
        rotation: (3, 3) attitude, from body to world axes.
        rates: (3,) angular velocity in body axes [rad/s].
        forces: (4,) of the rotors [N], for the next step.
    """

    def __init__(self, engine: Engine, position: FloatArray, velocity: FloatArray):
        self._engine = engine
        engine.setTimeStep(1.0 / RATE)
        engine.setGravity(0.0, 0.0, -flights.GRAVITY)
        self._body = engine.createMultiBody(baseMass=MASS, basePosition=position.tolist())
        engine.changeDynamics(
            self._body, -1, localInertiaDiagonal=INERTIA.tolist(), linearDamping=0.0, angularDamping=0.0
        )
        thrust = np.array([0.0, 0.0, flights.GRAVITY]) - flights.drag(velocity)
        quaternion = Rotation.from_matrix(desired_attitude(thrust)).as_quat().tolist()
        engine.resetBasePositionAndOrientation(self._body, position.tolist(), quaternion)
        engine.resetBaseVelocity(self._body, velocity.tolist(), [0.0, 0.0, 0.0])
        self.forces = np.full(4, MASS * math.sqrt(thrust @ thrust) / 4.0)
        self._read()

    def step(self) -> None:
        """Advance by 1 / `RATE` seconds with the rotor forces, their yaw torque, and drag at the centre."""
        engine, body = self._engine, self._body
        for rotor, force in zip(_ROTOR_LISTS, self.forces.tolist(), strict=True):
            engine.applyExternalForce(body, -1, (0.0, 0.0, force), rotor, engine.LINK_FRAME)
        yaw = (TORQUE_SHARE * float(SPIN @ self.forces) * self.rotation[:, 2]).tolist()
        engine.applyExternalTorque(body, -1, yaw, engine.WORLD_FRAME)
        drag = (MASS * flights.drag(self.velocity)).tolist()
        engine.applyExternalForce(body, -1, drag, self.position.tolist(), engine.WORLD_FRAME)
        engine.stepSimulation()
        self._read()

    def _read(self) -> None:
        position, quaternion = self._engine.getBasePositionAndOrientation(self._body)
        velocity, rates = self._engine.getBaseVelocity(self._body)
        self.position, self.velocity = np.array(position), np.array(velocity)
        self.rotation = np.array(self._engine.getMatrixFromQuaternion(quaternion)).reshape(3, 3)
        self.rates = np.array(rates) @ self.rotation


def stored_flight(folder: Path, seed: int, attempt: int) -> Flight | None:
    """The flight of an attempt, None if it failed, from its file or flown and written to it.

    Args:
        folder: of the files; it exists.
        seed: of the routes.
        attempt: its number.

    Raises:
        ArgumentError: PyBullet is not installed, or the file cannot be written.
    """
    file = folder / f"quadrotor-{seed}-{attempt}.npz"
    route = flight_route(seed, attempt)
    try:
        with file.open("rb") as stored, np.load(stored) as arrays:
            points, flight = arrays["points"], Flight(arrays["positions"], arrays["velocities"])
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        points = None
    if not np.array_equal(points, route.control_points):
        flight = fly_quadrotor(route) or Flight(np.empty((0, 3)), np.empty((0, 3)))
        part = file.with_name(f".{file.stem}-{secrets.token_hex(4)}.npz")
        try:
            np.savez(
                part, points=route.control_points, positions=flight.positions, velocities=flight.velocities
            )
            os.replace(part, file)
        except OSError as error:
            raise ArgumentError(f"{file} cannot be written: {error}") from None
    return flight if len(flight.positions) else None
