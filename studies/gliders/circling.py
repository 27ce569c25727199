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
    LONGEST_WEIGHT,
    LabelRules,
    Labels,
    find_turns,
    row_edges,
    smoothed_states,
)
from studies.flights.turns import BoolArray, FloatArray, IntArray

CIRCLES = LabelRules(
    jerk=1.0,
    peak=4.0,
    bound=4.0,
    change=270.0,
    duration=0.0,
    merge=10.0,
)
"""Circles of rule a. Rule b knows when there are circles, and its rule here only how long they
must be.
"""
DECODED = replace(CIRCLES, peak=1e-3, bound=1e-3)
UNSCORED = 180.0
"""Turns of 180 to 270 deg are neither circles nor straight flight."""

# Time of the mean turn rate, and of a hodograph [s].
MEAN, WINDOW = 4.0, 40.0
# By the velocity in the window of a hodograph.
TURNED = np.radians(300.0)
# Largest wind, in radii of the hodograph.
CALMEST = 1.5
# Airspeed below which turn rates are as at this one [m/s].
SLOWEST = 1.0
# Positions that are smoothed at once.
PART, MARGIN = 600, 60
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
    batch = stack_flights(flights, PART, MARGIN)
    states = batch.unstack(
        smoothed_states(batch, CIRCLES.jerk),
        [len(flight.times) for flight in flights],
    )
    found = []
    for flight, state in zip(flights, states, strict=True):
        motion = AirMotion(*(np.zeros(state.shape[:1] + shape) for shape in ((), (), (2,))))
        for piece in flight.pieces:
            rows = slice(*piece)
            times, ground, acceleration = flight.times[rows], state[rows, 1::3], state[rows, 2::3]
            motion.wind[rows] = hodograph_wind(times, ground)
            air = ground - motion.wind[rows]
            motion.speeds[rows] = np.hypot(*air.T)
            across = air[:, 0] * acceleration[:, 1] - air[:, 1] * acceleration[:, 0]
            rates = across / np.maximum(motion.speeds[rows], SLOWEST) ** 2
            counts = window_sums(times, MEAN, np.ones(len(times)))
            motion.rates[rows] = window_sums(times, MEAN, rates) / counts
        found.append(motion)
    return found


def hodograph_wind(times: FloatArray, velocities: FloatArray) -> FloatArray:
    """Return the wind (n, 2) [m/s], interpolated between circles; without any 0.

    It is the centre of the circle through the ground velocities of 40 s, by the algebraic fit of
    Kasa 1976, "A circle fitting procedure and its error analysis".

    Args:
        times: (n,) [s].
        velocities: (n, 2) over the ground [m/s].
    """
    rows = np.column_stack([2.0 * velocities, np.ones(len(times))])
    squares = (velocities**2).sum(1)
    angles = np.unwrap(np.arctan2(velocities[:, 1], velocities[:, 0]))
    turned = window_sums(
        times,
        WINDOW,
        np.diff(angles, prepend=angles[0]),
    )
    used = np.abs(turned) > TURNED
    # The normal equations of each window; two velocities in one place have a solution too.
    normal = window_sums(times, WINDOW, rows[:, :, None] * rows[:, None, :])[used]
    right = window_sums(times, WINDOW, rows * squares[:, None])[used]
    scale = np.trace(normal, axis1=1, axis2=2)[:, None, None] if used.any() else 1.0
    centre = np.linalg.solve(
        normal + 1e-12 * scale * np.eye(3),
        right[..., None],
    )[..., 0]
    radius = np.sqrt(
        np.maximum(
            centre[:, 2] + (centre[:, :2] ** 2).sum(1),
            0.0,
        )
    )
    kept = np.hypot(*centre[:, :2].T) < CALMEST * radius
    if not kept.any():
        return np.zeros_like(velocities)
    known = times[used][kept]
    return np.column_stack([np.interp(times, known, values) for values in centre[kept, :2].T])


def window_sums(times: FloatArray, width: float, values: FloatArray) -> FloatArray:
    """Return sums of values (n, ...) over the rows within half a width [s] before and after each
    row.
    """
    first = np.searchsorted(times, times - 0.5 * width)
    end = np.searchsorted(times, times + 0.5 * width, "right")
    sums = np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)])
    return np.asarray(sums[end] - sums[first])


def circles(
    flight: Flight,
    rates: FloatArray,
    rules: LabelRules = CIRCLES,
) -> tuple[IntArray, BoolArray]:
    """Return the modes (n,) of a flight with turn rates (n,) [rad/s], and where they are
    doubtful.
    """
    modes = np.zeros(len(rates), np.int64)
    doubtful = np.zeros(len(rates), np.bool_)
    for piece in flight.pieces:
        rows = slice(*piece)
        edges = row_edges(flight.times[slice(*piece)])
        modes[rows] = find_turns(edges, rates[rows], rules)[0]
        doubtful[rows] = (
            find_turns(edges, rates[rows], replace(rules, change=UNSCORED))[0] != modes[rows]
        )
    return modes, doubtful


def label_glider(flight: Flight, motion: AirMotion, decoded: IntArray) -> Labels:
    """Return the labels of a flight; their `own` modes are those of rule b.

    Args:
        flight: the flight.
        motion: its motion in the air.
        decoded: (n,) what `decode` says of it.
    """
    modes, doubtful = circles(flight, motion.rates)
    other, unsure = circles(
        flight,
        np.where(decoded == 1, motion.rates, 0.0),
        DECODED,
    )
    scored = (decoded != NOT_FLYING) & (modes == other) & ~doubtful & ~unsure
    weights = np.zeros(len(modes))
    for piece in flight.pieces:
        widths = np.diff(row_edges(flight.times[slice(*piece)]))
        weights[slice(*piece)] = np.minimum(widths, LONGEST_WEIGHT * float(np.median(widths)))
    scored &= weights > 0.0
    known = np.flatnonzero(scored)
    # Elsewhere the mode of the nearest row.
    if known.size:
        modes = modes[known][
            np.searchsorted(
                0.5 * (known[1:] + known[:-1]),
                np.arange(len(modes)),
            )
        ]
    return Labels(
        flight.times,
        modes,
        scored,
        np.where(scored, weights, 0.0),
        motion.rates,
        motion.speeds,
        other,
    )


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
