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

import numpy as np
from scipy.interpolate import BPoly

from baselines import Decider, OnlineTracker
from hybrid_env import QuickestOptions
from studies.flights.flight import Flight, stack_flights
from studies.flights.labels import LabelRules, Labels, Pair, smoothed_states
from studies.flights.turns import FloatArray, IntArray

# The default environment; a flight begins at any moment of a mode that nobody knows.
WORLD = QuickestOptions(start="random")
DEVIATION = float(np.sqrt(WORLD.variances[0]))


def semi_real_flight(flight: Flight, labels: Labels, generator: np.random.Generator) -> Pair:
    """Return a flight at ticks of 1 s with white noise, and its labels. The speed v is the median
    over the ticks at speeds that are scored. The tier has sigma as `across`, and no error of the
    time. A tick has the label of the nearest position; it is not scored if that is not, or is 1.5
    median steps away.
    """
    states = smoothed_states(stack_flights([flight]))
    parts = []
    for column, piece in enumerate(flight.pieces):
        times = flight.times[piece]
        moments = np.arange(times[0], times[-1] + 1e-9)
        nearest = piece.start + np.searchsorted(0.5 * (times[1:] + times[:-1]), moments)
        smoothed = smooth_path(times, states[: len(times), column], moments)
        parts.append(np.column_stack([moments, nearest, smoothed]))
    ticks, row, x, vx, y, vy = np.concatenate(parts).T
    rows = row.astype(np.int64)
    speeds = np.hypot(vx, vy)
    moving = speeds >= LabelRules().speed
    speed = np.median(speeds[moving] if moving.any() else speeds)
    sigma = float(speed) * DEVIATION / (WORLD.speed * WORLD.tau)
    near = np.abs(labels.times[rows] - ticks) <= 1.5 * np.median(np.diff(labels.times))
    scored = labels.scored[rows] & near
    noisy = Flight(
        flight.identity,
        flight.tier._replace(across=sigma, timing=0.0),
        ticks,
        np.stack([x, y], 1) + sigma * generator.standard_normal((len(ticks), 2)),
    )
    return noisy, Labels(
        ticks, labels.modes[rows], scored, scored * 1.0, labels.rates[rows], speeds
    )


def smooth_path(times: FloatArray, states: FloatArray, ticks: FloatArray) -> FloatArray:
    """Return the path [x, vx, y, vy], (T, 4), at ticks [s] within smoothed states [x, vx, ax, y,
    vy, ay] at times [s]. With white jerk the expected path between two states is the polynomial of
    degree five through both.
    """
    # (n, derivative, axis)
    path = BPoly.from_derivatives(times, states.reshape(-1, 2, 3).swapaxes(1, 2))
    both = np.stack([path(ticks), path.derivative()(ticks)], axis=-1)
    return both.reshape(-1, 4)


def state_semi_real(decider: Decider, flights: Sequence[Flight]) -> list[IntArray]:
    """Return the statements, (T, 1), of a decider for the options `WORLD` on flights of
    `semi_real_flight`.
    """
    tracker = OnlineTracker(WORLD, decider)
    results = []
    for flight in flights:
        stated = np.zeros((len(flight.times), 1), np.int64)
        scale = DEVIATION / flight.tier.across
        for rows in flight.pieces:
            tracker.begin()
            points = (flight.positions[rows] - flight.positions[rows.start]) * scale
            stated[rows, 0] = [tracker.update(tuple(point)).mode for point in points.tolist()]
        results.append(stated)
    return results
