"""Recorded flights in the setting of `HybridTrackQuickest-v0`: real motion, simulated noise.

The path of the smoother of the labels, at ticks of one second, is taken for the true one. White
noise is added, equal in both axes, with which a tick at the speed of the flight is as long as one
of the default environment: v tau / sigma = 0.63. With lengths in units of sigma and times in ticks,
the environment's deciders read a flight as they are. Its turns have a radius of 25 v s, which is
2.3 deg/s: that of a bank of 20 deg at 90 m/s, and of 25 deg at 115 m/s (tan bank = v omega / g);
aircraft in civil traffic turn at 3 deg/s or with a bank of 25 deg, whichever is slower (ICAO Doc
8168).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.interpolate import BPoly

from baselines import Decider, OnlineTracker
from hybrid_env import QuickestOptions
from studies.flights.flight import Flight, stack_flights
from studies.flights.labels import LONGEST_WEIGHT, LabelRules, Labels, smoothed_states
from studies.flights.turns import FloatArray, IntArray

# [s]
TICK = 1.0

# The default environment; a flight begins at any moment of a mode that nobody knows.
WORLD = QuickestOptions(start="random")


def semi_real_flights(
    flights: Sequence[Flight],
    labels: Sequence[Labels],
    generator: np.random.Generator,
) -> tuple[list[Flight], list[Labels]]:
    """Return flights at ticks of 1 s with white noise, and their labels. The speed v is the median
    over the ticks at speeds that are scored. The tier has sigma as `across`, and no error of the
    time. A tick has the label of the nearest position; it is not scored if that is not, or is 1.5
    median steps away.
    """
    batch = stack_flights(flights)
    states = smoothed_states(batch, LabelRules().jerk)
    parts: list[list[tuple[FloatArray, FloatArray, IntArray]]] = [[] for _ in flights]
    for column, (k, first, end) in enumerate(batch.pieces):
        times = flights[k].times[first:end]
        ticks = np.arange(times[0], times[-1] + 1e-9, TICK)
        path = smooth_path(times, states[: end - first, column], ticks)
        nearest = first + np.searchsorted(0.5 * (times[1:] + times[:-1]), ticks)
        parts[k].append((ticks, path, nearest))
    made = []
    kept = []
    for flight, label, part in zip(flights, labels, parts, strict=True):
        ticks, path, rows = (np.concatenate(one) for one in zip(*part, strict=True))
        speeds = np.hypot(path[:, 1], path[:, 3])
        moving = speeds >= LabelRules().speed
        sigma = noise_deviation(float(np.median(speeds[moving] if moving.any() else speeds)))
        positions = path[:, ::2] + sigma * generator.standard_normal((len(path), 2))
        far = np.abs(label.times[rows] - ticks) > 0.5 * LONGEST_WEIGHT * float(
            np.median(np.diff(label.times))
        )
        scored = label.scored[rows] & ~far
        tier, tracks = flight.tier._replace(across=sigma, timing=0.0), flight.tracks[rows]
        made.append(
            replace(
                flight,
                tier=tier,
                times=ticks,
                positions=positions,
                tracks=tracks,
            )
        )
        weights = np.where(scored, TICK, 0.0)
        of_ticks = label.modes[rows], scored, weights, label.rates[rows], speeds, label.own[rows]
        kept.append(Labels(ticks, *of_ticks))
    return made, kept


def smooth_path(times: FloatArray, states: FloatArray, ticks: FloatArray) -> FloatArray:
    """Return the path [x, vx, y, vy], (T, 4), at ticks [s] within smoothed states [x, vx, ax, y,
    vy, ay] at times [s]. With white jerk the expected path between two states is the polynomial of
    degree five through both.
    """
    # (n, derivative, axis)
    derivatives = states.reshape(-1, 2, 3).swapaxes(1, 2)
    path = BPoly.from_derivatives(times, derivatives)
    both = np.stack(
        [path(ticks), path.derivative()(ticks)],
        axis=-1,
    )
    return np.asarray(both.reshape(-1, 4))


def noise_deviation(speed: float) -> float:
    """Return the standard deviation of the noise [m] for a speed [m/s]."""
    return speed * TICK * float(np.sqrt(WORLD.variances[0])) / (WORLD.speed * WORLD.tau)


def state_semi_real(decider: Decider, flights: Sequence[Flight]) -> list[IntArray]:
    """Return the statements, (T,), of a decider for the options `WORLD` on flights of
    `semi_real_flights`.
    """
    tracker = OnlineTracker(WORLD, decider)
    results = []
    for flight in flights:
        stated = np.zeros(len(flight.times), np.int64)
        scale = float(np.sqrt(WORLD.variances[0])) / flight.tier.across
        for first, end in flight.pieces:
            tracker.begin()
            points = ((flight.positions[first:end] - flight.positions[first]) * scale).tolist()
            for row, (x, y) in enumerate(points, first):
                stated[row] = tracker.update((x, y)).mode
        results.append(stated)
    return results
