"""Quadrotor flights in files, because each takes some seconds; a killed run goes on with the next flight."""

import os
import secrets
import zipfile
from pathlib import Path

import numpy as np

from baselines.papers.novospaskyi.flights import Flight, flight_path
from baselines.papers.novospaskyi.quadrotor import fly_quadrotor
from hybrid_env.checks import ArgumentError


def flight_file(folder: Path, seed: int, attempt: int) -> Path:
    """File of an attempt."""
    return folder / f"quadrotor-{seed}-{attempt}.npz"


def load_flight(file: Path, seed: int, attempt: int) -> tuple[bool, Flight | None]:
    """Whether the attempt is stored, and its flight, None if it failed."""
    try:
        with file.open("rb") as stored, np.load(stored) as arrays:
            points, positions, velocities = (arrays[name] for name in ("points", "positions", "velocities"))
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return False, None
    if not np.array_equal(points, flight_path(seed, attempt).control_points):
        return False, None
    return True, Flight(positions, velocities) if len(positions) else None


def fly_and_store(folder: Path, seed: int, attempt: int) -> None:
    """Fly an attempt with the quadrotor and write its file, unless it is there.

    Raises:
        ArgumentError: PyBullet is not installed, or the file cannot be written.
    """
    file = flight_file(folder, seed, attempt)
    if load_flight(file, seed, attempt)[0]:
        return
    path = flight_path(seed, attempt)
    flight = fly_quadrotor(path) or Flight(np.empty((0, 3)), np.empty((0, 3)))
    part = file.with_name(f".{file.stem}-{secrets.token_hex(4)}.npz")
    try:
        np.savez(part, points=path.control_points, positions=flight.positions, velocities=flight.velocities)
        os.replace(part, file)
    except OSError as error:
        raise ArgumentError(f"{file} cannot be written: {error}") from None
