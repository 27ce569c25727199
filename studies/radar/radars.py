"""Radars near a flight, their measurements merged in time, and the errors of estimates. Sections
2.1.3 and 3.1. The thesis does not state the limits of the distances and heights, nor whether the
radars scan at the same moments. Here they scan in turn, half a period apart. Independent phases are
excluded by the published row of the g-h filter: its velocity gain h / t has no bound if two
measurements may follow each other at once.
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.stats import levy_stable

from studies.arrays import FloatArray, IntArray
from studies.radar.flights import Flight

Noise = Literal["gaussian", "levy"]
NOISE_NAMES: dict[Noise, str] = {"gaussian": "Gaussian noise", "levy": "Levy noise"}
# Largest distance of a measured object [m].
RANGE = 1000.0
# Time between the scans of a radar [s].
PERIOD = 1.0
# Standard deviation of the Gaussian noise on each axis, and scale of the Levy noise [m].
SIGMA = 12.5
# Index alpha of the symmetric alpha-stable (Levy) noise.
STABILITY = 1.5
# Largest magnitude of the Levy noise on an axis [m]; without a bound its variance is infinite. The
# thesis does not state it. The published unfiltered MAE (20.4 m) gives about 1600 m, and with it
# the unfiltered RMSE comes out as well.
CLIP = 1600.0


def place_radars(
    flight: Flight,
    generator: np.random.Generator,
    distances: tuple[float, float] = (100.0, 800.0),
    highest: float = 50.0,
    separation: float = 500.0,
) -> FloatArray:
    """Positions of the two radars of a flight, (2, 3) [m]: at horizontal distances from a point of
    the flight, up to a height, and at least so far from each other [m].
    """
    placed: list[FloatArray] = []
    while len(placed) < 2:
        x, y, _ = flight.positions[generator.integers(len(flight.positions))]
        distance = generator.uniform(*distances)
        azimuth = generator.uniform(0.0, 2.0 * math.pi)
        height = generator.uniform(0.0, highest)
        place = x + distance * math.cos(azimuth), y + distance * math.sin(azimuth), height
        radar = np.array(place)
        if all(np.linalg.norm(radar - other) >= separation for other in placed):
            placed.append(radar)
    return np.stack(placed)


def scan_flight(
    flight: Flight, generator: np.random.Generator, fewest: int = 10, phases: int = 1024
) -> tuple[FloatArray, FloatArray, IntArray]:
    """Place radars around a flight of at least some seconds; return their positions (2, 3) [m],
    the times of their measurements, (K,) [s] in this order, and the radar of each.

    With fewer measurements the radars are placed again. The phase of a pair is a binary fraction of
    the period: equal steps are then equal numbers, whose matrices are shared.
    """
    while True:
        radars = place_radars(flight, generator)
        seen: list[tuple[FloatArray, IntArray]] = []
        phase = generator.integers(phases) / phases * PERIOD
        for index, radar in enumerate(radars):
            first = (phase + index * PERIOD / 2) % PERIOD
            times = np.arange(first, flight.times[-1], PERIOD)
            near = np.linalg.norm(flight.states_at(times)[0] - radar, axis=1) <= RANGE
            seen.append((times[near], np.full(near.sum(), index)))
        times, numbers = (np.concatenate(values) for values in zip(*seen, strict=True))
        if len(times) >= fewest:
            break
    order = np.argsort(times, kind="stable")
    return radars, times[order], numbers[order]


def draw_noise(noise: Noise, count: int, generator: np.random.Generator) -> FloatArray:
    """Errors of measurements, (count, 3) [m]: Gaussian, or symmetric alpha-stable and clipped."""
    if noise == "gaussian":
        return generator.normal(0.0, SIGMA, (count, 3))
    levy = levy_stable(STABILITY, 0.0, scale=SIGMA)
    return np.clip(levy.rvs((count, 3), generator), -CLIP, CLIP)


@dataclass(frozen=True)
class Tracks:
    """Measurements of N flights, padded to the longest with NaN, and times with the last one."""

    # (K, N) [s]
    times: FloatArray
    # (K, N, 3) [m]
    measurements: FloatArray
    # (K, N, 3) true [m]
    positions: FloatArray
    # (K, N, 3) true [m/s]
    velocities: FloatArray


def flight_errors(estimates: FloatArray, truth: FloatArray) -> FloatArray:
    """Errors of estimates (K, N, 3) of each flight, (N, 2): RMSE as mean over the axes, as the
    tables of the thesis have it, and by its formula, of Euclidean distances, eq. (1.25). A missing
    truth is NaN.

    The tables cannot follow the formulas: without a filter, where the velocity is taken for 0, eq.
    (1.25) gives at least the mean speed, which is 50 m/s, and the tables have 24 m/s.
    """
    squares = np.nanmean((estimates - truth) ** 2, axis=0)
    return np.stack([np.sqrt(squares).mean(-1), np.sqrt(squares.sum(-1))], axis=-1)
