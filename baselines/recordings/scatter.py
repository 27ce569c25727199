"""What measurements show without a model of the motion: noise, outliers, jumps and speed."""

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from baselines.recordings.ticks import Piece, TickGrid
from hybrid_env.checks import AnyArray, ArgumentError, FloatArray, IntArray

# An outlier is this many standard deviations from its neighbours.
FAR = 7.0


def noise_estimate(grid: TickGrid) -> float | None:
    """Estimate the measurement variance R [unit of length squared]; None with too few measurements.

    The third difference of four measurements, of successive ticks d_k = (z_{k+3} - 3 z_{k+2} + 3
    z_{k+1} - z_k) / sqrt(20), cancels motion that is quadratic in time, and its noise has the
    variance R. R is (median |d_k| / 0.6745)^2, averaged over x and y, robust against outliers and
    switches. A turn adds about r (omega tau)^3 / 4.5 to
    |d|, and process noise Q tau^2 / 10 to R. The relative standard error is about 2.4 / sqrt(T).
    """
    tracks = []
    for piece in grid.pieces:
        rows = np.flatnonzero(piece.measured)
        tracks.append((rows, piece.measurements[rows]))
    deviations = noise_deviations(tracks)
    return None if deviations is None else float(np.mean(deviations**2))


def noise_deviations(tracks: Sequence[tuple[AnyArray, FloatArray]]) -> FloatArray | None:
    """Return the standard deviations (m,) of the noise of values (n, m) that each track has at its
    increasing times (n,), by their third differences as in `noise_estimate`; None with too few.
    """
    differences = np.concatenate([_differences(times, values, 4)[1] for times, values in tracks])
    if len(differences) < 5:
        return None
    # Median of |z| for a standard normal z.
    deviations: FloatArray = np.median(np.abs(differences), axis=0) / 0.6744897501960817
    return deviations


def without_errors(grid: TickGrid, jumps: bool = False) -> tuple[TickGrid, int]:
    """Return the grid without measurements that are errors of the sensor, see `_without_outliers`
    and, by option, `_without_bursts`, and their number. With a radar all are kept: its noise
    depends on the range.
    """
    if grid.radar is not None:
        return grid, 0
    count = 0
    for without in [_without_bursts] * jumps + [_without_outliers]:
        pieces = without(grid)
        removed = grid.measured - sum(int(piece.measured.sum()) for piece in pieces)
        # With a larger share far from their neighbours, the noise is not what its estimate says.
        if removed <= 0.1 * grid.measured:
            grid = grid._replace(pieces=tuple(pieces))
            count += removed
    return grid, count


def _without_outliers(grid: TickGrid) -> list[Piece]:
    """Return the pieces without measurements that are far from their neighbours: farther than `FAR`
    standard deviations, in either coordinate, from the cubic through the two measurements before
    and the two after, and farther than those next to it are from theirs, which it has spoilt.
    """
    noise = noise_estimate(grid)
    if not noise:
        return list(grid.pieces)
    pieces = []
    for piece in grid.pieces:
        rows = np.flatnonzero(piece.measured)
        first, differences = _differences(rows, piece.measurements[rows], 5)
        # In standard deviations; the measurement in the middle has the largest weight.
        size = np.abs(differences).max(1) / np.sqrt(noise)
        around = np.max([np.roll(size, shift) for shift in (-2, -1, 1, 2)], axis=0)
        pieces.append(piece.without(rows[first[(size > FAR) & (size >= around)] + 2]))
    return pieces


def _without_bursts(grid: TickGrid) -> list[Piece]:
    """Return the pieces without short runs of measurements elsewhere. A jump is a step far longer
    than others, which neither the step before nor the one after resembles. At most ten measurements
    between two jumps are errors of the sensor. Where a jump remains, a new piece begins.
    """
    noise = noise_estimate(grid) or 0.0
    steps_of = [_steps(piece) for piece in grid.pieces]
    every = np.concatenate([steps for _, steps in steps_of])
    if len(every) < 5:
        return list(grid.pieces)
    # Noise alone explains steps that long, and motion alone those in a tick: five usual ones.
    longest = FAR * math.sqrt(2.0 * noise)
    fastest = 5.0 * float(np.quantile(np.hypot(*every.T), 0.9))
    if longest == fastest == 0.0:
        return list(grid.pieces)
    pieces = []
    for piece, (rows, steps) in zip(grid.pieces, steps_of, strict=True):
        limits = longest / np.diff(rows) + fastest
        change = np.pad(np.hypot(*np.diff(steps, axis=0).T), 1, constant_values=np.inf)
        jump = (np.hypot(*steps.T) > limits) & (np.minimum(change[:-1], change[1:]) > 0.5 * limits)
        runs = np.split(rows, np.flatnonzero(jump) + 1)
        most = min(10, max(map(len, runs)) - 1)
        kept = [run for run in runs if len(run) > most or len(runs) == 1]
        short = [run for run in runs if len(run) <= most and len(runs) > 1]
        borders = [0]
        for before, after in pairwise(kept):
            a, b = before[-1], after[0]
            apart = np.hypot(*(piece.measurements[b] - piece.measurements[a]))
            if apart > longest + fastest * (b - a):
                borders.append(int(b))
        pieces += piece.without(np.concatenate([rows[:0], *short])).split(borders)
    return pieces


def _steps(piece: Piece) -> tuple[IntArray, FloatArray]:
    """Return the ticks with a measurement, (n,), and the steps between them for each tick, (n -
    1, 2).
    """
    rows = np.flatnonzero(piece.measured)
    return rows, np.diff(piece.measurements[rows], axis=0) / np.diff(rows)[:, None]


def without_standing(grid: TickGrid) -> tuple[TickGrid, int, float]:
    """Return the grid without the parts in which the object stands still, the number of their
    measurements, and the number of windows in the longest part. A new piece begins after each part.
    With a radar nothing is left out.

    A part is a window in which positions vary by no more than the noise, or by 3 % of the way that
    the object covers elsewhere in this time. The window is so long that a moving object leaves the
    noise, which it does not where it turns back. An object that stands for most of the time is not
    told from noise.
    """
    noise = noise_estimate(grid)
    # A quarter of the steps is longer, also if the object stands for half of the time. With equal
    # positions it may stand for longer.
    lengths = (step_length(grid, 5, share) for share in (0.75, 0.9, 0.95, 0.99))
    step = next(filter(None, lengths), 0.0) / 5.0
    if noise is None or step == 0.0 or grid.radar is not None:
        return grid, 0, 0.0
    # A moving object covers 12 standard deviations of the noise in a window.
    window = max(5, math.ceil(12.0 * math.sqrt(2.0 * noise) / step))
    largest = max(2.0 * noise * (1.0 + 3.0 / math.sqrt(window)), (0.03 * step * window) ** 2)
    pieces: list[Piece] = []
    count = longest = 0
    for piece in grid.pieces:
        rows = np.flatnonzero(piece.measured)
        if len(rows) < window:
            pieces.append(piece)
            continue
        positions = piece.measurements[rows] - piece.measurements[rows].mean(axis=0)
        windows = np.lib.stride_tricks.sliding_window_view(positions, window, axis=0)
        spread = windows.var(axis=-1).sum(axis=1)
        still = np.convolve(spread < largest, np.ones(window)) > 0.0
        begins = np.flatnonzero(np.diff(still, prepend=~still[0]))
        parts = piece.split([0, *rows[begins[1:]].tolist()])
        pieces += [part for part, at in zip(parts, begins, strict=True) if not still[at]]
        count += int(still.sum())
        rows_of = np.diff(begins, append=len(rows))[still[begins]]
        longest = max(longest, int(rows_of.max(initial=0)))
    if not pieces:
        raise ArgumentError(
            "the object stands still, or moves by less than the noise of its positions,"
            f" {math.sqrt(noise):.3g}: expected a moving one"
        )
    return grid._replace(pieces=tuple(pieces)), count, longest / window


def median_speed(grid: TickGrid, noise: float) -> float:
    """Return the median speed [unit of length / tick], of steps that exceed the noise by far, of
    at most 32 ticks.
    """
    speed = 0.0
    for ticks in (1, 2, 4, 8, 16, 32):
        step = step_length(grid, ticks)
        if step is None:
            break
        squared = max(step**2 - 4.0 * np.log(2.0) * noise, 0.0)
        speed = math.sqrt(squared) / ticks
        if squared > 10.0 * noise:
            break
    return speed


def step_length(grid: TickGrid, ticks: int = 1, share: float = 0.5) -> float | None:
    """Return the distance of measurements some ticks apart that a share of them does not exceed
    [unit of length], by default the median; None if there are none.
    """
    steps = [piece.measurements[ticks:] - piece.measurements[:-ticks] for piece in grid.pieces]
    lengths = np.hypot(*np.concatenate(steps).T)
    lengths = lengths[~np.isnan(lengths)]
    return float(np.quantile(lengths, share)) if lengths.size else None


def _differences(times: AnyArray, values: FloatArray, points: int) -> tuple[IntArray, FloatArray]:
    """Return the first rows (k,) of p = `points` successive values, (n, m), at increasing times,
    (n,), and their divided differences, (k, m). Differences have unit noise, and cancel polynomials
    of degree p - 2.
    """
    count = len(times) - points + 1
    if count < 1:
        return np.zeros(0, int), np.zeros((0, values.shape[1]))
    at = [slice(k, k + count) for k in range(points)]
    differences, squares = np.zeros((count, values.shape[1])), np.zeros(count)
    for here in at:
        weights = np.ones(count)
        for other in at:
            if other != here:
                weights /= times[here] - times[other]
        differences += weights[:, None] * (values[here] - values[at[0]])
        squares += weights**2
    differences /= np.sqrt(squares)[:, None]
    span = times[at[-1]] - times[at[0]]
    # Span of four or five measurements, over the median span.
    first = np.flatnonzero(span <= 2.0 * np.median(span))
    return first, differences[first]
