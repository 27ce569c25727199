"""Flights of a point mass: thrust with a lag, gravity and drag. The default: all flights at once."""

import numpy as np

from baselines.papers.novospaskyi import vehicle
from baselines.papers.novospaskyi.flights import Flight
from baselines.papers.novospaskyi.paths import Path


def fly_point_masses(paths: list[Path]) -> list[Flight | None]:
    """Fly through the waypoints of every path.

    The thrust vector approaches the command of `vehicle.thrust_command` with the time constant
    `vehicle.FORCE_LAG`. Each step of `vehicle.RECORD_STEP` is integrated by the midpoint rule.

    Args:
        paths: of N flights.

    Returns:
        The flight of each path, None where it failed.
    """
    guidance = vehicle.Guidance([path.waypoints for path in paths])
    position, velocity = guidance.start()
    step = vehicle.RECORD_STEP
    share = 1.0 - np.exp(-step / vehicle.FORCE_LAG)
    gravity = np.array([0.0, 0.0, -vehicle.GRAVITY])
    force = -gravity - vehicle.drag(velocity)  # in equilibrium
    positions, velocities, lengths = [position], [velocity], np.ones(len(paths), dtype=np.int64)
    while True:
        command = vehicle.thrust_command(position, velocity, guidance.targets(position))
        if not guidance.flying.any():
            break
        force = force + share * (command - force)
        middle = velocity + 0.5 * step * (force + gravity + vehicle.drag(velocity))
        position = position + step * middle
        velocity = velocity + step * (force + gravity + vehicle.drag(middle))
        positions.append(position)
        velocities.append(velocity)
        lengths += guidance.flying
    flown, speeds = np.stack(positions, axis=1), np.stack(velocities, axis=1)
    return [
        Flight(flown[index, :length].copy(), speeds[index, :length].copy()) if succeeded else None
        for index, (length, succeeded) in enumerate(zip(lengths, guidance.succeeded, strict=True))
    ]
