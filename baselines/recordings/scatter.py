"""What measurements show without a model of the motion: noise, outliers, jumps and speed."""

import math
from itertools import pairwise

import numpy as np

from baselines.recordings.ticks import Piece, TickGrid
from hybrid_env.checks import FloatArray, IntArray

# Differences.
FEWEST = 5
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
    differences = np.concatenate([_differences(piece, 4)[1] for piece in grid.pieces])
    if len(differences) < FEWEST:
        return None
    median = np.median(np.abs(differences), axis=0)
    # Median of |z| for a standard normal z.
    return float(np.mean((median / 0.6744897501960817) ** 2))


def without_outliers(grid: TickGrid) -> tuple[TickGrid, int]:
    """Return the grid without measurements that are far from their neighbours, and their number:
    farther than `FAR` standard deviations, in either coordinate, from the cubic through the two
    measurements before and the two after, and farther than those next to it are from theirs, which
    it has spoilt.
    """
    noise = noise_estimate(grid)
    if not noise:
        return grid, 0
    pieces = []
    count = 0
    for piece in grid.pieces:
        ticks, differences = _differences(piece, 5)
        # In standard deviations; the measurement in the middle has the largest weight.
        size = np.abs(differences).max(1) / np.sqrt(noise)
        around = np.max([np.roll(size, shift) for shift in (-2, -1, 1, 2)], axis=0)
        far = (size > FAR) & (size >= around)
        values = piece.measurements.copy()
        values[ticks[far, 2]] = np.nan
        count += int(far.sum())
        pieces.append(piece._replace(measurements=values))
    return _unless_many(grid, pieces, count)


def without_jumps(grid: TickGrid) -> tuple[TickGrid, int]:
    """Return the grid without short runs of measurements elsewhere, and the number of these
    measurements. A jump is a step far longer than others, which neither the step before nor the one
    after resembles. At most `longest_burst` measurements between two jumps are errors of the
    sensor. Where a jump remains, a new piece begins.
    """
    # Measurements between two jumps that are errors of the sensor.
    longest_burst = 10
    noise = noise_estimate(grid) or 0.0
    steps = np.concatenate([_steps(piece)[1] for piece in grid.pieces])
    if len(steps) < FEWEST:
        return grid, 0
    # Motion may reach five times the usual step.
    usual = np.quantile(np.hypot(*steps.T), 0.9)
    limits = FAR * math.sqrt(2.0 * noise), 5.0 * float(usual)
    if not sum(limits):
        return grid, 0
    pieces = []
    count = 0
    for piece in grid.pieces:
        values = piece.measurements.copy()
        runs = _runs(piece, *limits)
        for k, run in enumerate(runs):
            if len(runs) > 1 and len(run) <= longest_burst and len(run) < max(map(len, runs)):
                values[run] = np.nan
                count += len(run)
                runs[k] = run[:0]
        pieces += _split(
            piece._replace(measurements=values),
            [run for run in runs if len(run)],
            *limits,
        )
    return _unless_many(grid, pieces, count)


def _unless_many(grid: TickGrid, pieces: list[Piece], count: int) -> tuple[TickGrid, int]:
    """Return the grid with other pieces and their number of outliers, or as it was if these are
    too many.
    """
    # With a larger share far from their neighbours, the noise is not what its estimate says.
    return (
        (grid, 0) if count > 0.1 * grid.measured else (grid._replace(pieces=tuple(pieces)), count)
    )


def _steps(piece: Piece) -> tuple[IntArray, FloatArray]:
    """Return the ticks with a measurement, (n,), and the steps between them for each tick, (n -
    1, 2).
    """
    rows = np.flatnonzero(piece.measured)
    return rows, np.diff(piece.measurements[rows], axis=0) / np.diff(rows)[:, None]


def _runs(piece: Piece, noise: float, step: float) -> list[IntArray]:
    """Return the ticks with a measurement between the jumps. Noise alone explains steps as long as
    `noise`, and motion alone those of `step` for each tick.
    """
    rows, steps = _steps(piece)
    limits = noise / np.diff(rows) + step
    change = np.pad(np.hypot(*np.diff(steps, axis=0).T), 1, constant_values=np.inf)
    jump = (np.hypot(*steps.T) > limits) & (np.minimum(change[:-1], change[1:]) > 0.5 * limits)
    return np.split(rows, np.flatnonzero(jump) + 1)


def _split(piece: Piece, runs: list[IntArray], noise: float, step: float) -> list[Piece]:
    """Divide a piece before each run that is too far from the one before."""
    borders = [0]
    for last, following in pairwise(runs):
        a = last[-1]
        b = following[0]
        if np.hypot(*(piece.measurements[b] - piece.measurements[a])) > noise + step * (b - a):
            borders.append(int(b))
    parts = []
    for first, end in pairwise([*borders, len(piece.measurements)]):
        a, b = np.searchsorted(piece.ticks, [first, end]).tolist()
        ticks = piece.ticks[a:b] - first
        late = piece.late[a:b]
        values = piece.measurements[first:end]
        rates = piece.rates[first:end]
        parts.append(Piece(piece.first + a, piece.first + b, ticks, late, values, rates))
    return parts


def standing_ticks(grid: TickGrid, variance: float, speed: float) -> int:
    """Return the number of ticks in which the object stands: ten successive measurements are
    not farther apart than six standard deviations of the noise, of a variance [unit of length
    squared] or as estimated, although the speed [unit of length / tick] takes it far beyond.
    """
    standing = 10
    apart = 6.0 * math.sqrt(max(variance, noise_estimate(grid) or 0.0))
    if speed * standing < 5.0 * apart:
        return 0
    total = 0
    for piece in grid.pieces:
        rows = np.flatnonzero(piece.measured)
        if len(rows) < standing:
            continue
        windows = np.lib.stride_tricks.sliding_window_view(
            piece.measurements[rows],
            standing,
            axis=0,
        )
        still = np.flatnonzero((np.ptp(windows, axis=2) < apart).all(1))
        total += len(np.unique(still[:, None] + np.arange(standing)))
    return total


def median_speed(grid: TickGrid, noise: float) -> float:
    """Return the median speed [unit of length / tick], of steps that exceed the noise by far, of
    at most 32 ticks.
    """
    speed = 0.0
    for ticks in (1, 2, 4, 8, 16, 32):
        step = median_step(grid, ticks)
        if step is None:
            break
        squared = max(step**2 - 4.0 * np.log(2.0) * noise, 0.0)
        speed = math.sqrt(squared) / ticks
        if squared > 10.0 * noise:
            break
    return speed


def median_step(grid: TickGrid, ticks: int = 1) -> float | None:
    """Return the median distance of measurements some ticks apart [unit of length], None if
    there are none.
    """
    steps = [piece.measurements[ticks:] - piece.measurements[:-ticks] for piece in grid.pieces]
    lengths = np.hypot(*np.concatenate(steps).T)
    lengths = lengths[~np.isnan(lengths)]
    return float(np.median(lengths)) if lengths.size else None


def _differences(piece: Piece, points: int) -> tuple[IntArray, FloatArray]:
    """Return ticks, (n, m), and divided differences, (n, 2), of m = `points` successive
    measurements. Differences have unit noise, and cancel polynomials of degree m - 2.
    """
    rows = np.flatnonzero(piece.measured)
    if len(rows) < points:
        return np.zeros((0, points), int), np.zeros((0, 2))
    ticks = np.lib.stride_tricks.sliding_window_view(rows, points)
    span = ticks[:, -1] - ticks[:, 0]
    # Span of four or five measurements, over the median span.
    ticks = ticks[span <= 2.0 * np.median(span)]
    times = (ticks - ticks[:, :1]).astype(float)
    apart = times[:, :, None] - times[:, None, :] + np.eye(points)
    weights = 1.0 / apart.prod(2)
    weights /= np.sqrt((weights**2).sum(1, keepdims=True))
    values = piece.measurements[ticks]
    return ticks, np.einsum("am,amx->ax", weights, values - values[:, :1])
