"""What each flight was doing, from a smoother that sees the whole flight.

The Rauch-Tung-Striebel smoother of constant acceleration gives the turn rate at every position.
Rows in which it exceeds a bound are a candidate; candidates that turn fast, far and long enough are
turns, other rows are straight motion. Rows in which this cannot be said with confidence are not
scored: candidates that are no turns (slow drifts, wiggles), low speeds, and rows in which the same
rules say something else when they are applied to the track angle that the aircraft reports from its
own sensors.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from baselines import KalmanFilter, MotionModel, run_filter, smooth
from studies.flights.flight import Flight, stack_flights
from studies.flights.turns import LEFT, RIGHT, STRAIGHT, Batch, BoolArray, FloatArray, IntArray

MODE_NAMES = ("straight", "left", "right")

# Of velocity and acceleration at the start [m/s, m/s^2].
START_DEVIATIONS = (200.0, 5.0)
# Time over which the rate of the own track angle is taken [s].
OWN_WINDOW = 10.0
# Positions before and after that give the velocity of the noise model.
NEIGHBOURS = 3
# Steps; time in longer gaps is not scored.
LONGEST_WEIGHT = 3.0


@dataclass(frozen=True, kw_only=True)
class LabelRules:
    """Settings of the labels.

    Attributes:
        jerk: spectral density of the white jerk of the smoother [m^2/s^5].
        peak: largest turn rate that a turn must reach [deg/s].
        bound: turn rate at which it begins and ends [deg/s].
        change: smallest change of heading [deg].
        duration: shortest turn [s]; it must also last 1.5 steps.
        merge: candidates of one direction with a shorter gap are one [s].
        speed: slowest speed that is scored [m/s].
    """

    jerk: float = 1.0
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
        own: (n,) modes from the aircraft's own track angle; -1 without one.
    """

    times: FloatArray
    modes: IntArray
    scored: BoolArray
    weights: FloatArray
    rates: FloatArray
    speeds: FloatArray
    own: IntArray

    @property
    def pieces(self) -> list[tuple[int, int, int]]:
        """First row, end and mode of each label."""
        begins = np.flatnonzero(np.diff(self.modes, prepend=-1))
        ends = np.append(begins[1:], len(self.modes))
        return list(zip(begins.tolist(), ends.tolist(), self.modes[begins].tolist(), strict=True))


def label_flights(flights: Sequence[Flight]) -> list[Labels]:
    """Return the labels of flights."""
    rules = LabelRules()
    batch = stack_flights(flights)
    rates, speeds = smoothed_rates(batch, rules.jerk)
    lengths = [len(flight.times) for flight in flights]
    arrays = zip(
        flights,
        batch.unstack(rates, lengths),
        batch.unstack(speeds, lengths),
        strict=True,
    )
    return [label_flight(*of_flight, rules) for of_flight in arrays]


def label_flight(
    flight: Flight,
    rates: FloatArray,
    speeds: FloatArray,
    rules: LabelRules,
) -> Labels:
    """Return the labels of one flight; rows outside of its pieces are not scored.

    Args:
        flight: the flight.
        rates: (n,) turn rate [rad/s].
        speeds: (n,) [m/s].
        rules: settings.
    """
    n = len(flight.times)
    modes = np.zeros(n, np.int64)
    own = np.full(n, -1)
    weights = np.zeros(n)
    scored, inside = np.zeros((2, n), np.bool_)
    for first, end in flight.pieces:
        rows = slice(first, end)
        inside[rows] = True
        times = flight.times[rows]
        edges = row_edges(times)
        modes[rows], turning = find_turns(edges, rates[rows], rules)
        known = first + np.flatnonzero(~np.isnan(flight.tracks[rows]))
        if known.size > 2:
            own_rates = angle_rates(flight.times[known], flight.tracks[known])
            own[known] = find_turns(row_edges(flight.times[known]), own_rates, rules)[0]
        scored[rows] = (modes[rows] != STRAIGHT) | ~turning
        weights[rows] = np.minimum(
            np.diff(edges),
            LONGEST_WEIGHT * float(np.median(np.diff(times))),
        )
    scored &= (speeds >= rules.speed) & ((own < 0) | (own == modes))
    rates, speeds = (np.where(inside, values, 0.0) for values in (rates, speeds))
    return Labels(flight.times, modes, scored, np.where(scored, weights, 0.0), rates, speeds, own)


def scored_alike(labels: Labels, other: Labels) -> Labels:
    """Return labels that are scored only where those of another flight with the same times are
    scored too.
    """
    return replace(
        labels,
        scored=labels.scored & other.scored,
        weights=np.where(other.scored, labels.weights, 0.0),
    )


def smoothed_rates(batch: Batch, jerk: float) -> tuple[FloatArray, FloatArray]:
    """Return turn rates [rad/s] and speeds [m/s], (T, B), of the smoother that sees the whole
    flight.
    """
    states = smoothed_states(batch, jerk)
    vx, ax, vy, ay = (states[..., k] for k in (1, 2, 4, 5))
    squares = vx**2 + vy**2
    return (vx * ay - vy * ax) / np.maximum(squares, 1e-12), np.sqrt(squares)


def smoothed_states(batch: Batch, jerk: float) -> FloatArray:
    """Return the states [x, vx, ax, y, vy, ay] of this smoother, (T, B, 6) [m, m/s, m/s^2]."""
    noises = batch.noise(local_velocities(batch))
    model = MotionModel("CA", 2, jerk)
    filtered = run_filter(
        KalmanFilter(model, 1.0, START_DEVIATIONS),
        batch.positions,
        batch.times,
        noises=noises,
    )
    return np.asarray(smooth(model, filtered, batch.times).states)


def local_velocities(batch: Batch) -> FloatArray:
    """Return the mean velocity (T, B, 2) [m/s] from three positions before to three after; 0
    when padded.
    """
    total, tracks = batch.times.shape
    last = batch.present.sum(0) - 1
    rows = np.arange(total)[:, None]
    before = np.clip(rows - NEIGHBOURS, 0, last)
    after = np.clip(rows + NEIGHBOURS, 0, last)
    which = np.arange(tracks)
    moved = batch.positions[after, which] - batch.positions[before, which]
    passed = batch.times[after, which] - batch.times[before, which]
    return np.asarray(moved / np.where(passed > 0.0, passed, np.inf)[..., None])


def row_edges(times: FloatArray) -> FloatArray:
    """Return the edges (n + 1,) of the time that each row stands for [s]."""
    middle = 0.5 * (times[1:] + times[:-1])
    return np.concatenate([times[:1], middle, times[-1:]])


def find_turns(
    edges: FloatArray,
    rates: FloatArray,
    rules: LabelRules,
) -> tuple[IntArray, BoolArray]:
    """Return the mode of every row, (n,), and whether its turn rate exceeds the bound.

    Args:
        edges: (n + 1,) of the rows [s].
        rates: (n,) [rad/s].
        rules: settings.
    """
    bound, peak = np.radians([rules.bound, rules.peak])
    shortest = max(
        rules.duration,
        1.5 * float(np.median(np.diff(edges))),
    )
    modes = np.zeros(len(rates), np.int64)
    turning = np.abs(rates) > bound
    for mode, sign in (
        (LEFT, 1.0),
        (RIGHT, -1.0),
    ):
        flags = np.concatenate([[False], sign * rates > bound, [False]]).astype(np.int8)
        firsts = np.flatnonzero(np.diff(flags) == 1)
        ends = np.flatnonzero(np.diff(flags) == -1)
        if not firsts.size:
            continue
        apart = edges[firsts[1:]] - edges[ends[:-1]] >= rules.merge
        for first, end in zip(
            firsts[np.append(True, apart)],
            ends[np.append(apart, True)],
            strict=True,
        ):
            rows = slice(int(first), int(end))
            widths = np.diff(edges[rows.start : rows.stop + 1])
            turned = abs(float((rates[rows] * widths).sum()))
            enough = turned >= np.radians(rules.change) and widths.sum() >= shortest
            if enough and (sign * rates[rows]).max() > peak:
                modes[rows] = mode
    return modes, turning


def angle_rates(times: FloatArray, angles: FloatArray) -> FloatArray:
    """Return the rate (n,) of angles [rad], the slope of a line over 10 s, or over three rows if
    longer.
    """
    unwrapped = np.unwrap(angles)
    rows = np.arange(len(times))
    first = np.minimum(
        np.searchsorted(times, times - 0.5 * OWN_WINDOW),
        np.maximum(rows - 1, 0),
    )
    end = np.maximum(
        np.searchsorted(times, times + 0.5 * OWN_WINDOW, "right"),
        np.minimum(rows + 2, len(times)),
    )
    origin = times - times[0]

    def total(values: FloatArray) -> FloatArray:
        sums = np.concatenate([[0.0], np.cumsum(values)])
        return np.asarray(sums[end] - sums[first])

    count = (end - first).astype(np.float64)
    t, a, tt, ta = (total(values) for values in (origin, unwrapped, origin**2, origin * unwrapped))
    spread = tt - t * t / count
    return np.asarray((ta - t * a / count) / np.maximum(spread, 1e-9))
