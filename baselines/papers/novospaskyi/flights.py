"""Recorded flights, and the generation of a set of them; failed flights are discarded."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

from baselines.papers.novospaskyi.paths import Path, random_path
from baselines.papers.novospaskyi.vehicle import RECORD_STEP

FloatArray = NDArray[np.float64]

FLIGHTS = 133
"""Number of flights of the thesis."""


@dataclass(frozen=True)
class Flight:
    """States every `vehicle.RECORD_STEP` seconds from time 0.

    Attributes:
        positions: (T, 3) [m].
        velocities: (T, 3) [m/s].
    """

    positions: FloatArray
    velocities: FloatArray

    @property
    def times(self) -> FloatArray:
        """Times of the states, (T,) [s]."""
        return np.asarray(RECORD_STEP * np.arange(len(self.positions)), np.float64)

    def states_at(self, times: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Positions [m] and velocities [m/s], each (K, 3), at times within the flight, (K,) [s]."""
        curve = CubicHermiteSpline(self.times, self.positions, self.velocities)
        return np.asarray(curve(times), np.float64), np.asarray(curve(times, 1), np.float64)


def flight_path(seed: int, attempt: int) -> Path:
    """Path of one attempt; it depends on nothing but the seed and the number of the attempt."""
    return random_path(np.random.default_rng((seed, 0, attempt)))


def generate_flights(
    count: int, seed: int, fly: Callable[[list[Path]], list[Flight | None]], batch: int
) -> Iterator[Flight]:
    """The first successful flights of the attempts 0, 1, 2 ...

    Args:
        count: number of flights.
        seed: seed of the paths.
        fly: flight model, for example `point_mass.fly_point_masses`.
        batch: number of attempts that are passed to `fly` at once; it does not change the flights.

    Yields:
        Successful flights, in the order of the attempts.
    """
    attempt = flown = 0
    while flown < count:
        paths = [flight_path(seed, number) for number in range(attempt, attempt + batch)]
        attempt += batch
        for flight in fly(paths):
            if flight is not None and flown < count:
                flown += 1
                yield flight
