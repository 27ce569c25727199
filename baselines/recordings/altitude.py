"""Climbs and descents of a recording: altitudes as pieces of one rate each.

Where the rate changes follows by penalised least squares with exact pruning (PELT): Killick,
Fearnhead & Eckley 2012, "Optimal detection of changepoints with a linear computational cost", with
a line for each piece. The rates are those of the continuous line with these corners that fits best.
"""

from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike
from scipy.sparse import csr_array, hstack

from hybrid_env.checks import BoolArray, FloatArray, IntArray

# Rows of the shortest piece.
SHORTEST = 4


class VerticalMotion(NamedTuple):
    """What n altitudes say, in K pieces of one rate each; NaN where nothing is known."""

    # (n,) altitude, rate, and the standard deviation of the rate.
    altitudes: FloatArray
    rates: FloatArray
    deviations: FloatArray
    # (K, 2) first row and end of each piece.
    pieces: IntArray
    # (K, 3) rate of each, its standard deviation, and the least rate that is told from 0.
    of_pieces: FloatArray
    # Of the errors of the altitudes, the largest of all parts.
    variance: float

    def words(self) -> list[str]:
        """Return what each piece is: climb, descend, or level where its rate may be 0 or is a
        fiftieth of the largest one.
        """
        rates, _, least = self.of_pieces.T
        least = np.maximum(least, 0.02 * np.abs(rates).max(initial=0.0))
        climbs = np.sign(rates) * (np.abs(rates) > least)
        return [["level", "climb", "descend"][int(side)] for side in climbs]


def vertical_motion(times: FloatArray, altitudes: FloatArray, parts: ArrayLike) -> VerticalMotion:
    """Decide where an object climbs, descends or stays level.

    Args:
        times: (n,) of the rows, increasing.
        altitudes: (n,) measured, NaN where there is none.
        parts: (P, 2) first row and end of the parts between gaps.
    """
    rows, largest = np.full((3, len(times)), np.nan), 0.0
    pieces, of_pieces = [np.empty((0, 2), int)], [np.empty((0, 3))]
    for first, end in np.asarray(parts).tolist():
        known = first + np.flatnonzero(np.isfinite(altitudes[first:end]))
        known = known[~_far(altitudes[known])]
        if len(known) < 2 * SHORTEST:
            continue
        # Exact in any unit.
        t = (times[known] - times[known[0]]) / (times[known[-1]] - times[known[0]])
        z = altitudes[known] - altitudes[known[0]]
        corners, values, deviations, scatter = _fitted_line(t, z)
        largest = max(largest, scatter)
        length = times[known[-1]] - times[known[0]]
        borders = np.append(known[np.searchsorted(t, corners[:-1])], known[-1] + 1)
        widths = np.diff(corners) * length
        rates, deviations = np.diff(values) / widths, deviations / length
        inside = np.arange(known[0], known[-1] + 1)
        place = (np.searchsorted(borders, inside, side="right") - 1).clip(0, len(rates) - 1)
        shares = (times[inside] - times[known[0]]) / length
        rows[0, inside] = altitudes[known[0]] + np.interp(shares, corners, values)
        rows[1:, inside] = rates[place], deviations[place]
        pieces.append(np.column_stack([borders[:-1], borders[1:]]))
        least = np.maximum(3.0 * deviations, 3.0 * scatter / widths)
        of_pieces.append(np.column_stack([rates, deviations, least]))
    joined = np.concatenate(pieces), np.concatenate(of_pieces)
    return VerticalMotion(rows[0], rows[1], rows[2], *joined, largest**2)


def _far(z: FloatArray) -> BoolArray:
    """Return which altitudes (n,) are errors, far from those around: numbers for no altitude."""
    if len(z) < SHORTEST:
        return np.zeros(len(z), np.bool_)
    around = sliding_window_view(np.pad(z, 2, "edge"), 5)
    apart = np.abs(z - np.median(around, axis=1))
    low, usual, high = np.quantile(z, 0.05), np.quantile(apart, 0.9), np.quantile(z, 0.95)
    return np.asarray(apart > 10.0 * usual + 0.05 * (high - low))


def _fitted_line(t: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, float]:
    """Return the corners (K + 1,) of the line through altitudes, its values there, the standard
    deviations (K,) of its rates, and that of the errors of the altitudes.
    """
    # Rows of a longer recording are joined to so many means.
    every = -(-len(t) // 20_000)
    starts = np.arange(0, len(t), every)
    if every > 1:
        t, z = (np.add.reduceat(v, starts) / np.diff(np.append(starts, len(t))) for v in (t, z))
    bent = np.sort(np.diff(z, 2) ** 2)
    # Without the largest, which are corners.
    noise = float(bent[: -(len(bent) // -100) * 99].mean()) / 6.0
    variance = max(noise, (1e-6 * float(np.ptp(z))) ** 2, 1e-300)
    # Errors with memory look like climbs: they count as fewer independent ones.
    for _ in range(3):
        line = _moved(_without_small(_changes(t, z, variance), t, z, variance), t, z, variance)
        errors = line.errors
        scatter = float(np.mean(errors**2))
        alike = float((errors[1:] * errors[:-1]).mean()) / max(scatter, 1e-300)
        alike = min(max(alike, 0.0), 0.95)
        effective = scatter * (1.0 + alike) / (1.0 - alike)
        if effective < 1.5 * variance:
            break
        variance = effective
    information, width, slopes = line.information / variance, np.diff(line.corners), line.slopes
    # Of the values, and then of the inner corners.
    count = len(width)
    by_values = np.eye(count, count + 1, 1) - np.eye(count, count + 1)
    by_corners = -slopes[:, None] * by_values[:, 1:-1]
    gradient = np.hstack([by_values, by_corners]) / width[:, None]
    spread = _inverse(information)
    variances = np.einsum("ki,ij,kj->k", gradient, spread, gradient)
    return line.corners, line.values, np.sqrt(variances.clip(0.0)), float(np.sqrt(scatter))


class _Line(NamedTuple):
    """A continuous line with K pieces that fits n altitudes best."""

    corners: FloatArray
    values: FloatArray
    # (n,) altitudes less the line.
    errors: FloatArray
    # (2 K, 2 K) about the values and the inner corners, for errors of variance 1.
    information: FloatArray
    # (K - 1,) of half the sum of the squared errors, by the inner corners, negative.
    gradient: FloatArray

    @property
    def slopes(self) -> FloatArray:
        """(K,) rates."""
        return np.asarray(np.diff(self.values) / np.diff(self.corners))


def _fit(corners: FloatArray, t: FloatArray, z: FloatArray) -> _Line:
    """Return the line with some corners."""
    place = np.searchsorted(corners, t, side="right").clip(1, len(corners) - 1) - 1
    share = (t - corners[place]) / np.diff(corners)[place]
    rows, size = len(t), len(corners)
    weights, places = np.stack([1.0 - share, share], 1), np.stack([place, place + 1], 1)
    hats = csr_array((weights.ravel(), places.ravel(), 2 * np.arange(rows + 1)), (rows, size))
    values = _inverse((hats.T @ hats).toarray()) @ (hats.T @ z)
    errors = z - hats @ values
    # If a corner moves on, the line before it falls by the rate, and so does the one behind it. The
    # first and the last corner do not move.
    falls = -(np.diff(values) / np.diff(corners))[place]
    change = hstack([hats, hats[:, 1:-1].multiply(falls[:, None])])
    gradient = (change.T @ errors)[size:]
    return _Line(corners, values, errors, (change.T @ change).toarray(), gradient)


def _inverse(information: FloatArray) -> FloatArray:
    """Return the inverse of an information, also if it says nothing of a direction."""
    # Over the mean.
    little = 1e-12 * np.trace(information) / len(information)
    return np.asarray(np.linalg.inv(information + little * np.eye(len(information))))


def _penalty(rows: int) -> float:
    """Return what a corner costs [variances]: three parameters by the Bayesian criterion, twice."""
    return 6.0 * float(np.log(rows))


def _changes(t: FloatArray, z: FloatArray, variance: float) -> FloatArray:
    """Return the borders (K + 1,) between pieces with a line each."""
    terms = np.stack([np.ones_like(t), t, z, t**2, t * z, z**2])
    sums = np.hstack([np.zeros((6, 1)), np.cumsum(terms, axis=1)])
    count, penalty = len(t), _penalty(len(t))
    best, last = np.full(count + 1, np.inf), np.zeros(count + 1, int)
    best[0] = -penalty
    # Where the last piece may begin.
    begins = np.zeros(1, int)
    for end in range(SHORTEST, count + 1):
        n, s, h, ss, sh, hh = sums[:, [end]] - sums[:, begins]
        within = hh - h * h / n - (sh - s * h / n) ** 2 / np.maximum(ss - s * s / n, 1e-300)
        total = best[begins] + np.maximum(within, 0.0) / variance
        k = int(total.argmin())
        best[end], last[end] = total[k] + penalty, begins[k]
        begins = begins[total <= best[end]]
        if end >= 2 * SHORTEST - 1:
            begins = np.append(begins, end - SHORTEST + 1)
    borders = [count]
    while borders[-1] > 0:
        borders.append(int(last[borders[-1]]))
    inner = np.array(borders[-2:0:-1], int)
    return np.concatenate([t[:1], 0.5 * (t[inner - 1] + t[inner]), t[-1:]])


def _without_small(corners: FloatArray, t: FloatArray, z: FloatArray, variance: float) -> _Line:
    """Return the line with the corners whose change of the rate is larger than chance."""
    while True:
        line = _fit(corners, t, z)
        if len(corners) == 2:
            return line
        width, size = np.diff(corners), len(corners)
        rows = np.arange(size - 2)
        bends = np.zeros((size - 2, size))
        bends[rows, rows], bends[rows, rows + 2] = 1.0 / width[:-1], 1.0 / width[1:]
        bends[rows, rows + 1] = -1.0 / width[:-1] - 1.0 / width[1:]
        spread = _inverse(line.information[:size, :size])
        variances = variance * np.einsum("ki,ij,kj->k", bends, spread, bends)
        squares = np.diff(line.slopes) ** 2 / variances
        # Smaller than those beside it.
        sides = np.pad(squares, 1, constant_values=np.inf)
        small = (squares <= sides[:-2]) & (squares < sides[2:])
        small &= squares <= 2.0 * _penalty(len(t))
        if not small.any():
            return line
        corners = np.delete(corners, np.flatnonzero(small) + 1)


def _moved(line: _Line, t: FloatArray, z: FloatArray, variance: float) -> _Line:
    """Return the line whose corners are where it fits best, by the method of Gauss and Newton."""
    size = len(line.corners)
    step = 4.0 * float(np.median(np.diff(t)))
    for _ in range(5 if size > 2 else 0):
        held = line.information.copy()
        held[range(size, 2 * size - 2), range(size, 2 * size - 2)] += variance / step**2
        change = _inverse(held)[size:, size:] @ line.gradient
        room = 0.4 * np.minimum(np.diff(line.corners)[:-1], np.diff(line.corners)[1:])
        corners = line.corners.copy()
        corners[1:-1] += np.clip(change, -room, room)
        moved = _fit(corners, t, z)
        if (moved.errors**2).sum() >= (line.errors**2).sum():
            break
        line = moved
    return line
