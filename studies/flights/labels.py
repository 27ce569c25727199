"""What each flight was doing, from a smoother that sees the whole flight.

The Rauch-Tung-Striebel smoother of constant acceleration gives the turn rate at every position.
Rows in which it exceeds a bound are a candidate; candidates that turn fast, far and long enough are
turns, other rows are straight motion. Rows in which this cannot be said with confidence are not
scored: candidates that are no turns (slow drifts, wiggles), low speeds, and rows in which the same
rules say something else when they are applied to the track angle that the aircraft reports from its
own sensors.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from studies.filters.kalman import KalmanFilter
from studies.filters.motion_models import MotionModel
from studies.filters.run_filter import run_filter
from studies.filters.smoother import smooth
from studies.flights.flight import Flight, stack_flights
from studies.flights.turns import LEFT, RIGHT, STRAIGHT, Batch, BoolArray, FloatArray, IntArray

MODE_NAMES = ("straight", "left", "right")


@dataclass(frozen=True, kw_only=True)
class LabelRules:
    """Settings of the labels.

    Attributes:
        peak: largest turn rate that a turn must reach [deg/s].
        bound: turn rate at which it begins and ends [deg/s].
        change: smallest change of heading [deg].
        duration: shortest turn [s]; it must also last 1.5 steps.
        merge: candidates of one direction with a shorter gap are one [s].
        speed: slowest speed that is scored [m/s].
    """

    peak: float = 0.75
    bound: float = 0.35
    change: float = 15.0
    duration: float = 8.0
    merge: float = 6.0
    speed: float = 8.0


@dataclass(frozen=True, eq=False)
class Labels:
    """Labels of one flight.

    Attributes:
        times: (n,) of its positions [s].
        modes: (n,) straight 0, left turn 1, right turn 2.
        scored: (n,) False where the mode is uncertain.
        weights: (n,) time that a row stands for [s]; 0 where it is not scored.
        rates: (n,) smoothed turn rate [rad/s], anticlockwise.
        speeds: (n,) smoothed speed [m/s].
    """

    times: FloatArray
    modes: IntArray
    scored: BoolArray
    weights: FloatArray
    rates: FloatArray
    speeds: FloatArray

    @property
    def shown(self) -> IntArray:
        """(n,) modes, or 3 where they are not scored."""
        return np.where(self.scored, self.modes, len(MODE_NAMES))


Pair = tuple[Flight, Labels]


def spans(values: IntArray, pieces: Sequence[slice]) -> Iterator[tuple[slice, int]]:
    """Yield rows and value of each run of equal values in pieces."""
    for rows in pieces:
        changes = rows.start + np.flatnonzero(np.diff(values[rows])) + 1
        for first, end in pairwise([rows.start, *changes.tolist(), rows.stop]):
            yield slice(first, end), int(values[first])


def label_flights(flights: Sequence[Flight]) -> list[Labels]:
    """Return the labels of flights."""
    rules = LabelRules()
    batch = stack_flights(flights)
    states = smoothed_states(batch)
    vx, ax, vy, ay = (states[..., k] for k in (1, 2, 4, 5))
    squares = vx**2 + vy**2
    rates = batch.unstack((vx * ay - vy * ax) / np.maximum(squares, 1e-12))
    speeds = batch.unstack(np.sqrt(squares))
    return [label_flight(*each, rules) for each in zip(flights, rates, speeds, strict=True)]


def label_flight(
    flight: Flight, rates: FloatArray, speeds: FloatArray, rules: LabelRules
) -> Labels:
    """Return the labels of one flight with turn rates (n,) [rad/s] and speeds [m/s]; rows outside
    of its pieces are not scored.
    """
    modes, turning = np.zeros((2, len(rates)), np.int64)
    inside, agreeing = np.zeros((2, len(rates)), np.bool_)
    reported = np.broadcast_to(flight.tracks, len(rates))
    for rows in flight.pieces:
        inside[rows] = agreeing[rows] = True
        modes[rows], turning[rows] = find_turns(row_edges(flight.times[rows]), rates[rows], rules)
        known = rows.start + np.flatnonzero(~np.isnan(reported[rows]))
        if known.size > 2:
            times = flight.times[known]
            others, _ = find_turns(row_edges(times), angle_rates(times, reported[known]), rules)
            agreeing[known] = others == modes[known]
    scored = agreeing & ((modes != STRAIGHT) | (turning == 0)) & (speeds >= rules.speed)
    return Labels(
        flight.times,
        modes,
        scored,
        np.where(scored, row_weights(flight), 0.0),
        np.where(inside, rates, 0.0),
        np.where(inside, speeds, 0.0),
    )


def row_weights(flight: Flight, longest: float = 3.0) -> FloatArray:
    """Return the time (n,) that each row stands for [s]: at most `longest` median steps of its
    piece, and 0 outside of pieces.
    """
    weights = np.zeros(len(flight.times))
    for rows in flight.pieces:
        times = flight.times[rows]
        longest_time = longest * np.median(np.diff(times))
        weights[rows] = np.minimum(np.diff(row_edges(times)), longest_time)
    return weights


def smoothed_states(batch: Batch) -> FloatArray:
    """Return the states [x, vx, ax, y, vy, ay], (T, B, 6) [m, m/s, m/s^2], of the smoother that
    sees the whole flight.
    """
    # Of the white jerk [m^2/s^5].
    model = MotionModel("CA", 2, 1.0)
    filtered = run_filter(
        # Standard deviations of velocity and acceleration at the start [m/s, m/s^2].
        KalmanFilter(model, 1.0, (200.0, 5.0)),
        batch.positions,
        batch.times,
        noises=batch.noise(local_velocities(batch)),
    )
    return smooth(model, filtered, batch.times).states


def local_velocities(batch: Batch, neighbours: int = 3) -> FloatArray:
    """Return the mean velocity (T, B, 2) [m/s] from some positions before to as many after; 0
    when padded.
    """
    last = batch.present.sum(0) - 1
    rows, columns = np.indices(batch.times.shape)
    before, after = (
        (np.clip(rows + shift, 0, last), columns) for shift in (-neighbours, neighbours)
    )
    moved = batch.positions[after] - batch.positions[before]
    passed = batch.times[after] - batch.times[before]
    return moved / np.where(passed > 0.0, passed, np.inf)[..., None]


def row_edges(times: FloatArray) -> FloatArray:
    """Return the edges (n + 1,) of the time that each row stands for [s]."""
    return np.concatenate([times[:1], 0.5 * (times[1:] + times[:-1]), times[-1:]])


def find_turns(
    edges: FloatArray, rates: FloatArray, rules: LabelRules
) -> tuple[IntArray, BoolArray]:
    """Return the mode of every row, (n,), and whether its turn rate exceeds the bound.

    Args:
        edges: (n + 1,) of the rows [s].
        rates: (n,) [rad/s].
        rules: settings.
    """
    bound, peak, change = np.radians([rules.bound, rules.peak, rules.change])
    widths = np.diff(edges)
    shortest = max(rules.duration, 1.5 * np.median(widths))
    modes = np.zeros(len(rates), np.int64)
    for mode, signed in ((LEFT, rates), (RIGHT, -rates)):
        flags = np.diff(signed > bound, prepend=False, append=False)
        firsts, ends = np.flatnonzero(flags).reshape(-1, 2).T
        apart = edges[firsts[1:]] - edges[ends[:-1]] >= rules.merge
        if not firsts.size:
            continue
        for rows in map(slice, firsts[np.append(True, apart)], ends[np.append(apart, True)]):
            turned = abs((rates[rows] * widths[rows]).sum())
            enough = turned >= change and widths[rows].sum() >= shortest
            if enough and signed[rows].max() > peak:
                modes[rows] = mode
    return modes, np.abs(rates) > bound


def angle_rates(times: FloatArray, angles: FloatArray, window: float = 10.0) -> FloatArray:
    """Return the rate (n,) of angles [rad], the slope of a line over a window [s], or over three
    rows if longer.
    """
    t, a = times - times[0], np.unwrap(angles)
    rows = np.stack([np.ones(len(t)), t, a, t * t, t * a], axis=1)
    count, t, a, tt, ta = window_sums(times, window, rows, 1).T
    return (ta - t * a / count) / np.maximum(tt - t * t / count, 1e-9)


def window_sums(times: FloatArray, width: float, values: FloatArray, least: int = 0) -> FloatArray:
    """Return sums of values (n, ...) over the rows within half a width [s] before and after each
    row, and over at least so many rows before and after it.
    """
    rows = np.arange(len(times))
    first = np.searchsorted(times, times - 0.5 * width)
    first = np.minimum(first, np.maximum(rows - least, 0))
    end = np.searchsorted(times, times + 0.5 * width, "right")
    end = np.maximum(end, np.minimum(rows + least + 1, len(times)))
    sums = np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)])
    return sums[end] - sums[first]
