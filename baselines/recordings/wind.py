"""The velocity of the medium in which an object turns: a wind or a current.

Seen from the ground, circles in a moving medium drift with it, and are wider where the object flies
with the wind. Seen from the medium they are circles. So a recording is tracked as seen from the
medium if its circles drift.
"""

import math
from collections.abc import Iterable, Sequence

import numpy as np

from baselines.recordings.decisions import RowDecisions
from baselines.recordings.ticks import TickGrid
from hybrid_env.checks import AnyArray, FloatArray
from hybrid_env.modes import Mode


def _errors(times: FloatArray, points: AnyArray, rates: FloatArray, drifts: bool) -> FloatArray:
    """Return the sum of the squared errors of the best circle at each of some turn rates, (k,),
    with a drift of its own or none. times, points: (n,), the points complex, x + i y of a left turn
    and the conjugate ones of a right turn.
    """
    times = times - times.mean()
    basis, _ = np.linalg.qr(np.stack([np.ones(len(times)), times][: 1 + drifts], axis=1))
    waves = np.exp(1j * np.outer(rates, times))
    waves -= (waves @ basis) @ basis.T
    rest = points - basis @ (basis.T @ points)
    shares = np.abs(waves.conj() @ rest) ** 2 / np.maximum((np.abs(waves) ** 2).sum(1), 1e-300)
    return np.maximum((np.abs(rest) ** 2).sum() - shares, 0.0)


def _turn_rate(times: FloatArray, points: AnyArray, drifts: bool) -> float:
    """Return the turn rate with the smallest error, at which there is a whole circle."""
    lowest = 2.0 * math.pi / np.ptp(times)
    highest = max(0.5 * math.pi / np.median(np.diff(times)), 1.01 * lowest)
    for _ in range(3):
        rates = np.geomspace(lowest, highest, 48)
        best = int(_errors(times, points, rates, drifts).argmin())
        lowest, highest = rates[max(best - 1, 0)], rates[min(best + 1, len(rates) - 1)]
    return float(rates[best])


def _drift(times: FloatArray, points: AnyArray, left: bool) -> AnyArray:
    """Return what the best circle with a drift does not explain of times and points, (2, n)
    complex.
    """
    waves = np.exp(1j * _turn_rate(times, points, True) * times)
    basis, _ = np.linalg.qr(np.stack([np.ones(len(waves)), waves], axis=1))
    both = np.stack([times, points], axis=1)
    rest = (both - basis @ (basis.conj().T @ both)).T
    return rest if left else rest.conj()


def find_wind(pieces: Iterable[tuple[FloatArray, FloatArray, bool]], fewest: int = 8) -> FloatArray:
    """Return the velocity (2,) of the medium in which an object circles, 0 if there is no sign of
    one: fewer than three windows of two circles, or circles that drift to no common direction.

    Args:
        pieces: times (n,), positions (n, 2) and side, True is left, of turns by whole circles.
        fewest: measurements of a window.
    """
    windows = []
    for times, positions, left in pieces:
        if len(times) < fewest:
            continue
        points = positions @ [1.0, 1j if left else -1j]
        # The mean turn rate at the begin of a long turn says its number of circles well enough.
        circles = _turn_rate(times[:10_000], points[:10_000], True) * np.ptp(times)
        circles /= 2.0 * math.pi
        # Over two circles the turn rate hardly changes.
        parts = np.array_split(np.arange(len(times)), max(int(circles / 2), 1))
        windows += [(times[rows], points[rows], left) for rows in parts if len(rows) >= fewest]
    # Fewer do not tell a wind from the error of a drifting sensor, which has no direction.
    if len(windows) < 3:
        return np.zeros(2)
    rest_times, rest_points = np.hstack([_drift(*window) for window in windows])
    wind = np.vdot(rest_times, rest_points) / np.vdot(rest_times, rest_times).real
    still = 0.0
    for times, points, _ in windows:
        rate = _turn_rate(times, points, False)
        still += float(_errors(times, points, np.array([rate]), False)[0])
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
            if radius and turned > 2.0 * math.pi:
                circles.append((moments[ticks], piece.measurements[ticks], radius > 0.0))
    return circles
