"""What a glider was doing: straight flight, circles to the left or to the right, by two rules.

Rule a sees the whole flight: a smoother, from whose velocities the wind is removed, gives the turn
rate in the air. The wind is the centre of the circle on which ground velocities lie while a glider
circles (its hodograph). Rule b is the Viterbi decoder of libigc, which another author wrote for the
same purpose. The label is what both say. Where they differ nothing is scored, and a change lies in
the middle. Both read the same positions.
"""

import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from studies.flights.flight import Flight, stack_flights
from studies.flights.labels import (
    LabelRules,
    Labels,
    find_turns,
    row_edges,
    smoothed_states,
    window_sums,
)
from studies.flights.turns import BoolArray, FloatArray, IntArray

CIRCLES = LabelRules(peak=4.0, bound=4.0, change=270.0, duration=0.0, merge=10.0)
"""Circles of rule a."""
NOT_FLYING = -1


class AirMotion(NamedTuple):
    """Motion in the air.

    Attributes:
        rates: (n,) mean turn rate of 4 s [rad/s], anticlockwise.
        speeds: (n,) airspeed [m/s].
        wind: (n, 2) to the east and north [m/s].
    """

    rates: FloatArray
    speeds: FloatArray
    wind: FloatArray


def air_motion(flights: Sequence[Flight]) -> list[AirMotion]:
    """Return the motion of flights in the air, by the smoother; 0 outside of their pieces."""
    batch = stack_flights(flights, 600, 60)
    motions = []
    states = batch.unstack(smoothed_states(batch))
    for flight, state in zip(flights, states, strict=True):
        rates, speeds, *wind = np.zeros((4, len(flight.times)))
        motion = AirMotion(rates, speeds, np.column_stack(wind))
        for rows in flight.pieces:
            times, ground, acceleration = flight.times[rows], state[rows, 1::3], state[rows, 2::3]
            motion.wind[rows] = hodograph_wind(times, ground)
            air = ground - motion.wind[rows]
            speeds[rows] = np.hypot(*air.T)
            across = air[:, 0] * acceleration[:, 1] - air[:, 1] * acceleration[:, 0]
            # Below 1 m/s as at this airspeed.
            turned = across / np.maximum(speeds[rows], 1.0) ** 2
            total, count = window_sums(times, 4.0, np.stack([turned, np.ones_like(turned)], 1)).T
            rates[rows] = total / count
        motions.append(motion)
    return motions


def hodograph_wind(times: FloatArray, velocities: FloatArray, window: float = 40.0) -> FloatArray:
    """Return the wind (n, 2) [m/s], interpolated between circles; without any 0.

    It is the centre of the circle through the ground velocities of a window in which they turn by
    300 deg, by the algebraic fit of Kasa 1976, "A circle fitting procedure and its error analysis".
    The wind is smaller than 1.5 of its radii.

    Args:
        times: (n,) [s].
        velocities: (n, 2) over the ground [m/s].
        window: [s].
    """
    rows = np.column_stack([2.0 * velocities, np.ones(len(times))])
    squares = (velocities**2).sum(1)
    angles = np.unwrap(np.arctan2(velocities[:, 1], velocities[:, 0]))
    turned = window_sums(times, window, np.diff(angles, prepend=angles[0]))
    used = np.abs(turned) > np.radians(300.0)
    # The normal equations of each window; two velocities in one place have a solution too.
    normal = window_sums(times, window, rows[:, :, None] * rows[:, None, :])[used]
    right = window_sums(times, window, rows * squares[:, None])[used]
    small = 1e-12 * np.trace(normal, axis1=1, axis2=2)[:, None, None] * np.eye(3)
    x, y, rest = np.linalg.solve(normal + small, right[..., None])[..., 0].T
    kept = np.hypot(x, y) < 1.5 * np.sqrt(np.maximum(rest + (x**2 + y**2), 0.0))
    if not kept.any():
        return np.zeros_like(velocities)
    return np.column_stack([np.interp(times, times[used][kept], axis[kept]) for axis in (x, y)])


def circles(
    flight: Flight, rates: FloatArray, rules: LabelRules = CIRCLES
) -> tuple[IntArray, BoolArray]:
    """Return the modes (n,) of a flight with turn rates (n,) [rad/s], and where they are
    doubtful: turns of 180 to 270 deg are neither circles nor straight flight.
    """
    modes, wider = np.zeros((2, len(rates)), np.int64)
    for rows in flight.pieces:
        edges = row_edges(flight.times[rows])
        modes[rows], _ = find_turns(edges, rates[rows], rules)
        wider[rows], _ = find_turns(edges, rates[rows], replace(rules, change=180.0))
    return modes, modes != wider


def label_glider(flight: Flight, motion: AirMotion, decoded: IntArray) -> Labels:
    """Return the labels of a flight from its motion in the air, and (n,) what `decode` says of
    it.
    """
    modes, doubtful = circles(flight, motion.rates)
    # Rule b knows when there are circles, and its rule here only how long they must be.
    rules = replace(CIRCLES, peak=1e-3, bound=1e-3)
    other, unsure = circles(flight, motion.rates * (decoded == 1), rules)
    weights = np.zeros(len(modes))
    for rows in flight.pieces:
        widths = np.diff(row_edges(flight.times[rows]))
        # Time in longer gaps is not scored.
        weights[rows] = np.minimum(widths, 3.0 * np.median(widths))
    scored = (decoded != NOT_FLYING) & (modes == other) & ~doubtful & ~unsure & (weights > 0.0)
    known = np.flatnonzero(scored)
    # Elsewhere the mode of the nearest row.
    if known.size:
        middle = 0.5 * (known[1:] + known[:-1])
        modes = modes[known][np.searchsorted(middle, np.arange(len(modes)))]
    return Labels(flight.times, modes, scored, weights * scored, motion.rates, motion.speeds)


def decode(records: Sequence[bytes]) -> IntArray:
    """Return what libigc says of B records: (n,) 1 circling, 0 straight flight, -1 not in flight.

    Raises:
        ModuleNotFoundError: libigc is not installed.
    """
    import libigc

    class Config(libigc.FlightParsingConfig):
        """As it comes, but logs with gaps and jumps of altitude are decoded too."""

        max_time_violations = max_alt_change_violations = len(records)

    # It reads files only.
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "flight.igc"
        path.write_bytes(b"\n".join([b"HFDTE010100", *records, b""]))
        flight = libigc.Flight.create_from_file(str(path), Config)
    if not flight.valid:
        return np.full(len(records), NOT_FLYING)
    return np.array([int(fix.circling) if fix.flying else NOT_FLYING for fix in flight.fixes])
