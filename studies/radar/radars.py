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
from numpy.typing import NDArray
from scipy.stats import levy_stable

from studies.radar.flights import Flight

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

Noise = Literal["gaussian", "levy"]
NOISES: tuple[Noise, ...] = ("gaussian", "levy")

RADARS = 2
# Largest distance of a measured object [m].
RANGE = 1000.0
# Time between the scans of a radar [s].
PERIOD = 1.0
# Smallest and largest horizontal distance between a radar and its point of the flight [m].
OFFSETS = (100.0, 800.0)
# Lowest and highest radar [m].
HEIGHTS = (0.0, 50.0)
# Smallest distance between two radars [m].
SEPARATION = 500.0
# Measurements of a flight; with fewer, its radars are placed again.
FEWEST = 10
# Standard deviation of the Gaussian noise on each axis, and scale of the Levy noise [m].
SIGMA = 12.5
# Index alpha of the symmetric alpha-stable (Levy) noise.
STABILITY = 1.5
# Largest magnitude of the Levy noise on an axis [m]; without a bound its variance is infinite. The
# thesis does not state it. The published unfiltered MAE (20.4 m) gives about 1600 m, and with it
# the unfiltered RMSE comes out as well.
CLIP = 1600.0
# Possible phases of a pair of radars in a period.
PHASES = 1024
# Of the flights, the first ones.
TRAINING_SHARE = 0.3
# Streams of random numbers of a seed; 0 draws the paths and 1 the radars.
TRAINING_NOISE, TEST_NOISE = 2, 3


@dataclass(frozen=True)
class Scan:
    """What the radars of one flight see, without noise; K measurements in the order of time."""

    # (`RADARS`, 3) their positions [m]
    radars: FloatArray
    # (K,) [s]
    times: FloatArray
    # (K,) index of the radar of each measurement.
    radar: IntArray
    # (K, 3) true [m]
    positions: FloatArray
    # (K, 3) true [m/s]
    velocities: FloatArray


def place_radars(flight: Flight, generator: np.random.Generator) -> FloatArray:
    """Positions of the radars of a flight, (`RADARS`, 3) [m]."""
    placed: list[FloatArray] = []
    while len(placed) < RADARS:
        point = flight.positions[generator.integers(len(flight.positions))]
        distance = generator.uniform(*OFFSETS)
        azimuth = generator.uniform(0.0, 2.0 * math.pi)
        height = generator.uniform(*HEIGHTS)
        radar = np.array(
            [
                point[0] + distance * math.cos(azimuth),
                point[1] + distance * math.sin(azimuth),
                height,
            ]
        )
        if all(np.linalg.norm(radar - other) >= SEPARATION for other in placed):
            placed.append(radar)
    return np.stack(placed)


def scan_flight(flight: Flight, generator: np.random.Generator) -> Scan:
    """Place radars around a flight of at least some seconds, and find the moments and states
    that they measure.
    """
    while True:
        radars = place_radars(flight, generator)
        seen: list[tuple[FloatArray, IntArray]] = []
        # A binary fraction of the period: equal steps are then equal numbers, whose matrices are
        # shared.
        phase = generator.integers(PHASES) / PHASES * PERIOD
        for index, radar in enumerate(radars):
            first = (phase + index * PERIOD / RADARS) % PERIOD
            times = np.arange(
                first,
                flight.times[-1],
                PERIOD,
            )
            near = np.linalg.norm(flight.states_at(times)[0] - radar, axis=1) <= RANGE
            seen.append((times[near], np.full(near.sum(), index)))
        times = np.concatenate([times for times, _ in seen])
        if len(times) >= FEWEST:
            break
    order = np.argsort(times, kind="stable")
    times = times[order]
    return Scan(
        radars,
        times,
        np.concatenate([index for _, index in seen])[order],
        *flight.states_at(times),
    )


def draw_noise(
    noise: Noise,
    count: int,
    generator: np.random.Generator,
) -> FloatArray:
    """Errors of measurements, (count, 3) [m]: Gaussian, or symmetric alpha-stable and clipped."""
    if noise == "gaussian":
        return generator.normal(0.0, SIGMA, (count, 3))
    errors = levy_stable.rvs(
        STABILITY,
        0.0,
        scale=SIGMA,
        size=(count, 3),
        random_state=generator,
    )
    return np.clip(errors, -CLIP, CLIP)


@dataclass(frozen=True)
class Tracks:
    """Measurements of N flights, padded to the longest with NaN, and times with the last one."""

    # (N, K) [s]
    times: FloatArray
    # (N, K, 3) [m]
    measurements: FloatArray
    # (N, K, 3) true [m]
    positions: FloatArray
    # (N, K, 3) true [m/s]
    velocities: FloatArray

    def errors(
        self,
        positions: FloatArray,
        velocities: FloatArray,
    ) -> FloatArray:
        """Position RMSE and MAE [m], velocity RMSE and MAE [m/s] of estimates (N, K, 3), (N, 4)."""
        found = flight_errors(positions, self.positions) + flight_errors(
            velocities,
            self.velocities,
        )
        return np.stack(found, axis=-1)


def padded_tracks(parts: Sequence[tuple[FloatArray, ...]]) -> Tracks:
    """Tracks of flights that each have the arrays of `Tracks` without the first axis."""
    longest = max(len(times) for times, *_ in parts)
    times = np.stack([np.pad(times, (0, longest - len(times)), mode="edge") for times, *_ in parts])
    arrays = np.full((3, len(parts), longest, 3), np.nan)
    for k, (own, *values) in enumerate(parts):
        arrays[:, k, : len(own)] = values
    return Tracks(times, *arrays)


def measure(
    scans: Sequence[Scan],
    noise: Noise,
    seed: tuple[int, ...],
) -> Tracks:
    """Add noise to the true positions of every scan; flight i has its own stream, whatever the
    others are.
    """
    parts = []
    for index, scan in enumerate(scans):
        errors = draw_noise(
            noise,
            len(scan.times),
            np.random.default_rng((*seed, index)),
        )
        parts.append((scan.times, scan.positions + errors, scan.positions, scan.velocities))
    return padded_tracks(parts)


def flight_errors(estimates: FloatArray, truth: FloatArray) -> tuple[FloatArray, FloatArray]:
    """RMSE and MAE (...) of estimates (..., K, 3) of each flight, means over the axes; a missing
    truth is NaN. Novospaskyi 2025, eq. (1.25) and (1.26), sum over the axes, but its tables do not:
    all eight unfiltered values come out as means over flights and axes of the error within a
    flight, and not the 21.7 and 29.9 m of a sum.
    """
    error = estimates - truth
    rmse = np.sqrt(np.nanmean(error**2, axis=-2)).mean(-1)
    return rmse, np.nanmean(np.abs(error), axis=-2).mean(-1)
