"""Radars near a flight, their measurements merged in time, and the errors of estimates. Sections
2.1.3 and 3.1. The thesis does not state the limits of the distances and heights, nor whether the
radars scan at the same moments. Here they scan in turn, half a period apart. Independent phases are
excluded by the published row of the g-h filter: its velocity gain h / t has no bound if two
measurements may follow each other at once.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.stats import levy_stable

from studies.arrays import FloatArray, IntArray
from studies.radar.flights import Flight

Noise = Literal["gaussian", "levy"]
NOISES: tuple[Noise, ...] = ("gaussian", "levy")
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


@dataclass(frozen=True)
class Scan:
    """What the radars of one flight see, without noise; K measurements in the order of time."""

    # (2, 3) their positions [m]
    radars: FloatArray
    # (K,) [s]
    times: FloatArray
    # (K,) index of the radar of each measurement.
    radar: IntArray
    # (K, 3) true [m]
    positions: FloatArray
    # (K, 3) true [m/s]
    velocities: FloatArray


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
) -> Scan:
    """Place radars around a flight of at least some seconds, and find the moments and states that
    they measure. With fewer measurements the radars are placed again. The phase of a pair is a
    binary fraction of the period: equal steps are then equal numbers, whose matrices are shared.
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
    return Scan(radars, times[order], numbers[order], *flight.states_at(times[order]))


def scan_flights(flights: Sequence[Flight], seed: int) -> tuple[list[Scan], int]:
    """Return the scans of flights, and how many of the first ones are for training: 30 %."""
    generators = (np.random.default_rng((seed, 1, k)) for k in range(len(flights)))
    scans = [scan_flight(*pair) for pair in zip(flights, generators, strict=True)]
    return scans, round(0.3 * len(flights))


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


def padded_tracks(parts: Sequence[tuple[FloatArray, ...]]) -> Tracks:
    """Tracks of flights that each have the arrays of `Tracks` without the second axis."""
    longest = max(len(times) for times, *_ in parts)
    times = np.stack([np.pad(times, (0, longest - len(times)), mode="edge") for times, *_ in parts])
    arrays = np.full((3, longest, len(parts), 3), np.nan)
    for k, (of_flight, *values) in enumerate(parts):
        arrays[:, : len(of_flight), k] = values
    return Tracks(times.T, *arrays)


def measure(scans: Sequence[Scan], noise: Noise, stream: tuple[int, ...]) -> Tracks:
    """Add noise to the true positions of every scan; flight i has its own stream of random numbers,
    whatever the others are: (seed, 2, i) for training, (seed, 3, run, i) for tests.
    """
    parts = []
    for index, scan in enumerate(scans):
        generator = np.random.default_rng((*stream, index))
        measured = scan.positions + draw_noise(noise, len(scan.times), generator)
        parts.append((scan.times, measured, scan.positions, scan.velocities))
    return padded_tracks(parts)


def flight_errors(estimates: FloatArray, truth: FloatArray) -> FloatArray:
    """Errors of estimates (K, N, 3) of each flight, (N, 2): RMSE as mean over the axes, as the
    tables of the thesis have it, and by its formula, of Euclidean distances, eq. (1.25). A missing
    truth is NaN.

    The tables cannot follow the formulas: without a filter, where the velocity is taken for 0, eq.
    (1.25) gives at least the mean speed, which is 50 m/s, and the tables have 24 m/s.
    """
    squares = np.nanmean((estimates - truth) ** 2, axis=0)
    return np.stack([np.sqrt(squares).mean(-1), np.sqrt(squares.sum(-1))], axis=-1)
