"""
A quadrotor with six degrees of freedom
=======================================

The radar study of Novospaskyi 2025 flies a point mass. Here a rigid body in the physics
engine `PyBullet <https://pybullet.org>`_ flies the same routes with the same guidance: four rotor forces with motor lag, and drag.
A geometric attitude controller follows the thrust command: Lee, Leok and McClamroch 2010, "Geometric tracking control of a
quadrotor UAV on SE(3)". ``pip install pybullet``
"""

# %%
# The body. PyBullet has no quadrotor, so it is built here.

import math

import matplotlib.pyplot as plt
import numpy as np
import pybullet as engine
from scipy.spatial.transform import Rotation

from studies.radar import flights
from studies.radar.flights import Flight, flight_route, fly_point_masses

RATE = 120  # steps of the controller and of the engine per second
MASS = 1.5  # kg
HALF_SIZE = (0.2, 0.2, 0.05)  # half of the body's size on each axis, for its inertia, m
ARM = 0.2  # distance of the rotors from the centre along each horizontal body axis, m; the rotors form a cross (x)
TORQUE_SHARE = 0.02  # yaw torque of a rotor over its force, m
MOTOR_LAG = 0.03  # time constant from commanded to actual rotor force, s
LARGEST_ROTOR_FORCE = (
    flights.LARGEST_FORCE * MASS / 4.0 * 1.2
)  # N; more than the guidance needs, so that torque remains
ATTITUDE_GAIN = 120.0  # angular acceleration for an attitude error of one, 1/s^2
RATE_GAIN = 20.0  # angular acceleration for a rate error of one, 1/s
ROTORS = ARM * np.array(
    [[1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0]]
)  # positions in body axes
SPIN = np.array([1.0, -1.0, 1.0, -1.0])  # sign of the yaw torque of each rotor
INERTIA = MASS / 3.0 * (np.dot(HALF_SIZE, HALF_SIZE) - np.square(HALF_SIZE))  # of a cuboid, kg m^2
MIXER = np.linalg.inv(np.stack([np.ones(4), ROTORS[:, 1], -ROTORS[:, 0], TORQUE_SHARE * SPIN]))


def cross(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Cross product of two vectors, (3,); much faster for one pair than `numpy.cross`."""
    a, b, c = first.tolist()
    d, e, f = second.tolist()
    return np.array([b * f - c * e, c * d - a * f, a * e - b * d])


def desired_attitude(thrust: np.ndarray) -> np.ndarray:
    """Attitude, (3, 3), with the third body axis along a thrust, (3,), and the first one towards world x."""
    third = thrust / math.sqrt(thrust @ thrust)
    second = cross(third, np.array([1.0, 0.0, 0.0]))
    second /= math.sqrt(second @ second)
    return np.stack([cross(second, third), second, third], axis=1)


def rotor_commands(
    rotation: np.ndarray, rates: np.ndarray, desired: np.ndarray, thrust: np.ndarray
) -> np.ndarray:
    """Forces of the four rotors, (4,) [N].

    Args:
        rotation: (3, 3) attitude, from body to world axes.
        rates: (3,) angular velocity in body axes [rad/s].
        desired: (3, 3) `desired_attitude` of the thrust.
        thrust: (3,) commanded thrust per mass in world axes [m/s^2].
    """
    skew = 0.5 * (desired.T @ rotation - rotation.T @ desired)  # Lee et al. 2010, eq. (10)
    error = np.array([skew[2, 1], skew[0, 2], skew[1, 0]])
    torque = INERTIA * (-ATTITUDE_GAIN * error - RATE_GAIN * rates) + cross(rates, INERTIA * rates)
    force = MASS * max(float(thrust @ rotation[:, 2]), 0.0)
    return np.minimum(np.maximum(MIXER @ np.array([force, *torque]), 0.0), LARGEST_ROTOR_FORCE)


class Quadrotor:
    """The body in the engine, with four rotors and drag.

    Args:
        position: (3,) at the start [m].
        velocity: (3,) at the start [m/s]; the attitude is that of steady flight at this velocity.

    Attributes:
        position: (3,) [m].
        velocity: (3,) [m/s].
        rotation: (3, 3) attitude, from body to world axes.
        rates: (3,) angular velocity in body axes [rad/s].
        forces: (4,) of the rotors [N], for the next step.
    """

    def __init__(self, position: np.ndarray, velocity: np.ndarray):
        engine.setTimeStep(1.0 / RATE)
        engine.setGravity(0.0, 0.0, -flights.GRAVITY)
        self._body = engine.createMultiBody(baseMass=MASS, basePosition=position.tolist())
        engine.changeDynamics(
            self._body,
            -1,
            localInertiaDiagonal=INERTIA.tolist(),
            linearDamping=0.0,
            angularDamping=0.0,
        )
        thrust = np.array([0.0, 0.0, flights.GRAVITY]) - flights.drag(velocity)
        quaternion = Rotation.from_matrix(desired_attitude(thrust)).as_quat().tolist()
        engine.resetBasePositionAndOrientation(self._body, position.tolist(), quaternion)
        engine.resetBaseVelocity(self._body, velocity.tolist(), [0.0, 0.0, 0.0])
        self.forces = np.full(4, MASS * math.sqrt(thrust @ thrust) / 4.0)
        self._read()

    def step(self) -> None:
        """Advance by 1 / `RATE` seconds with the rotor forces, their yaw torque, and drag at the centre."""
        body = self._body
        for rotor, force in zip(ROTORS.tolist(), self.forces.tolist(), strict=True):
            engine.applyExternalForce(body, -1, (0.0, 0.0, force), rotor, engine.LINK_FRAME)
        yaw = (TORQUE_SHARE * float(SPIN @ self.forces) * self.rotation[:, 2]).tolist()
        engine.applyExternalTorque(body, -1, yaw, engine.WORLD_FRAME)
        drag = (MASS * flights.drag(self.velocity)).tolist()
        engine.applyExternalForce(body, -1, drag, self.position.tolist(), engine.WORLD_FRAME)
        engine.stepSimulation()
        self._read()

    def _read(self) -> None:
        position, quaternion = engine.getBasePositionAndOrientation(self._body)
        velocity, rates = engine.getBaseVelocity(self._body)
        self.position, self.velocity = np.array(position), np.array(velocity)
        self.rotation = np.array(engine.getMatrixFromQuaternion(quaternion)).reshape(3, 3)
        self.rates = np.array(rates) @ self.rotation


# %%
# The guidance gives a thrust every twentieth of a second, and the controller follows it with the rotors. A flight fails if a
# waypoint is not reached in time, or if the quadrotor falls.


def fly_quadrotor(route):
    """Fly through the waypoints of a route; None if this fails."""
    guidance = flights.Guidance([route])
    position, velocity = (one[0] for one in guidance.start())
    engine.resetSimulation()
    quadrotor = Quadrotor(position, velocity)
    share = 1.0 - math.exp(-1.0 / (RATE * MOTOR_LAG))
    positions, velocities = [position], [velocity]
    while True:
        target = guidance.targets(positions[-1][None])[0]
        if not guidance.flying[0]:
            break
        thrust = flights.thrust_command(positions[-1], velocities[-1], target)
        desired = desired_attitude(thrust)
        for _ in range(round(RATE * flights.RECORD_STEP)):
            command = rotor_commands(quadrotor.rotation, quadrotor.rates, desired, thrust)
            quadrotor.forces += share * (command - quadrotor.forces)
            quadrotor.step()
        positions.append(quadrotor.position)
        velocities.append(quadrotor.velocity)
    return Flight(np.stack(positions), np.stack(velocities)) if guidance.succeeded[0] else None


# %%
# Both pass the same waypoints at nearly the same time. The first of these routes that both can fly:

engine.connect(engine.DIRECT)
for attempt in range(10):
    route = flight_route(0, attempt)
    (mass,), quadrotor = fly_point_masses([route]), fly_quadrotor(route)
    if mass is not None and quadrotor is not None:
        break
shortest = min(len(mass.positions), len(quadrotor.positions))
apart = np.linalg.norm(quadrotor.positions[:shortest] - mass.positions[:shortest], axis=1)
print(
    f"route {attempt}: {quadrotor.times[-1]:.1f} s of flight, apart by {np.median(apart):.1f} m in the median, at most {apart.max():.1f} m"
)

figure, (plane, distance) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
for flight, name in ((mass, "point mass"), (quadrotor, "quadrotor")):
    plane.plot(*flight.positions[:, :2].T / 1000.0, label=name)
plane.plot(*route[:, :2].T / 1000.0, "k.", markersize=3, label="waypoints")
plane.set(xlabel="x, km", ylabel="y, km", aspect="equal")
plane.legend(frameon=False)
distance.plot(quadrotor.times[:shortest], apart)
distance.set(xlabel="t, s", ylabel="apart, m", xlim=(0, None), ylim=(0, None))
distance.grid(alpha=0.25)
plt.show()
