"""The velocity of the medium in which an object turns: a wind or a current.

Seen from the ground, circles in a moving medium drift with it, and are wider where the object flies
with the wind. Seen from the medium they are circles. So a recording is tracked as seen from the
medium if its circles drift.
"""

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from baselines.recordings.decisions import RowDecisions
from baselines.recordings.ticks import TickGrid
from hybrid_env.checks import FloatArray, IntArray
from hybrid_env.modes import Mode

# Fewest measurements of a window.
WINDOW_ROWS = 8


class _Circles(NamedTuple):
    """What is measured of an object that circles to one side, as complex numbers x + i y."""

    # (n,)
    times: FloatArray
    # (n,) complex, the conjugate ones of a right turn.
    points: FloatArray
    left: bool

    def part(self, rows: IntArray) -> "_Circles":
        """Return some rows."""
        return self._replace(times=self.times[rows], points=self.points[rows])

    def errors(self, rates: FloatArray, drifts: bool) -> FloatArray:
        """Return the sum of the squared errors of the best circle at each of some turn rates, (k,),
        with a drift of its own or none.
        """
        times = self.times - self.times.mean()
        basis, _ = np.linalg.qr(np.stack([np.ones(len(times)), times][: 1 + drifts], axis=1))
        waves = np.exp(1j * np.outer(rates, times))
        waves -= (waves @ basis) @ basis.T
        rest = self.points - basis @ (basis.T @ self.points)
        shares = np.abs(waves.conj() @ rest) ** 2 / np.maximum((np.abs(waves) ** 2).sum(1), 1e-300)
        return np.maximum((np.abs(rest) ** 2).sum() - shares, 0.0)

    def rate(self, drifts: bool) -> float:
        """Return the turn rate with the smallest error, at which there is a whole circle."""
        lowest = 2.0 * math.pi / np.ptp(self.times)
        highest = max(0.5 * math.pi / np.median(np.diff(self.times)), 1.01 * lowest)
        for _ in range(3):
            rates = np.geomspace(lowest, highest, 48)
            best = int(self.errors(rates, drifts).argmin())
            lowest, highest = rates[max(best - 1, 0)], rates[min(best + 1, len(rates) - 1)]
        return float(rates[best])

    def drift(self) -> tuple[FloatArray, FloatArray]:
        """Return what the best circle with a drift does not explain of times and points, (n,)
        complex each.
        """
        waves = np.exp(1j * self.rate(True) * self.times)
        basis, _ = np.linalg.qr(np.stack([np.ones(len(waves)), waves], axis=1))
        both = np.stack([self.times, self.points], axis=1)
        times, points = (both - basis @ (basis.conj().T @ both)).T
        return (times, points) if self.left else (times.conj(), points.conj())


def find_wind(pieces: Iterable[tuple[FloatArray, FloatArray, bool]]) -> FloatArray:
    """Return the velocity (2,) of the medium in which an object circles, 0 if there is no sign of
    one: fewer than three windows of two circles, or circles that drift to no common direction.

    Args:
        pieces: times (n,), positions (n, 2) and side, True is left, of turns by whole circles.
    """
    windows = []
    for times, positions, left in pieces:
        turn = _Circles(times, positions @ [1.0, 1j if left else -1j], left)
        # The mean turn rate at the begin of a long turn says its number of circles well enough.
        circles = turn.part(np.arange(len(times))[:10_000]).rate(True) * np.ptp(times)
        circles /= 2.0 * math.pi
        # Over two circles the turn rate hardly changes.
        parts = np.array_split(np.arange(len(times)), max(int(circles / 2), 1))
        windows += [turn.part(rows) for rows in parts if len(rows) >= WINDOW_ROWS]
    # Fewer do not tell a wind from the error of a drifting sensor, which has no direction.
    if len(windows) < 3:
        return np.zeros(2)
    drifts = [each.drift() for each in windows]
    rest_times, rest_points = map(np.concatenate, zip(*drifts, strict=True))
    wind = np.vdot(rest_times, rest_points) / np.vdot(rest_times, rest_times).real
    still = sum(float(each.errors(np.array([each.rate(False)]), False)[0]) for each in windows)
    moving = float((np.abs(rest_points - wind * rest_times) ** 2).sum())
    # A wind that changes along a recording explains less, and would make other pieces wrong.
    return np.array([wind.real, wind.imag]) * (still > 4.0 * moving)


def circles_of(
    grid: TickGrid,
    times: Sequence[FloatArray],
    decisions: Sequence[RowDecisions],
    modes: Sequence[Mode],
) -> list[tuple[FloatArray, FloatArray, bool]]:
    """Return the turns of a recording by whole circles, see `find_wind`.

    Args:
        grid: of the recording.
        times: (T,) of the ticks of each piece.
        decisions: of each piece.
        modes: (M,) of the decisions.
    """
    circles = []
    for piece, moments, of_piece in zip(grid.pieces, times, decisions, strict=True):
        headings = np.unwrap(np.arctan2(*of_piece.estimates[:, [3, 1]].T))
        for first, end, mode, _ in of_piece.pieces.tolist():
            radius = modes[mode].signed_radius
            turned = abs(headings[end - 1] - headings[first])
            ticks = np.arange(piece.ticks[first], piece.ticks[end - 1] + 1)
            ticks = ticks[piece.measured[ticks]]
            if radius and turned > 2.0 * math.pi and len(ticks) >= WINDOW_ROWS:
                circles.append((moments[ticks], piece.measurements[ticks], radius > 0.0))
    return circles
