"""The rows of a recording on a grid of uniform ticks, as the filters of the banks need them; one
without a measurement is only predicted.

The tick of every row is that which a live tracker gives it, see `TickClock`. A clock that jitters
keeps one tick per row: for the fit of the model, a measurement made by e after its tick is moved
back by e times the local velocity, which a line through five measurements gives. For a turn of `a`
rad per tick this leaves an error of speed * tau * a * (e / tau)^2 / 2 at most, and its noise is
larger by at most 3 %. If the steps are irregular, the grid is finer than the median step. A row
that has no tick of its own is not used.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from baselines.recordings.clock import TickClock, advance
from baselines.recordings.recording import Recording
from hybrid_env.checks import BoolArray, FloatArray, IntArray, reject
from hybrid_env.compiled import compiled, run_compiled
from hybrid_env.sensors import Radar

MAX_TICKS = 5_000_000


class Piece(NamedTuple):
    """The T ticks of a piece of a recording between two gaps."""

    # Its rows in the recording.
    first: int
    end: int
    # (end - first,) tick of every row, from 0, not decreasing.
    ticks: IntArray
    # (end - first,) time of every row after that of its tick [time unit]
    late: FloatArray
    # (T, 2) [unit of length]; NaN without a measurement.
    measurements: FloatArray
    # (T, k) range rates or velocities, see `Recording`; NaN without one.
    rates: FloatArray

    @property
    def measured(self) -> BoolArray:
        """(T,) True at ticks with a measurement."""
        return ~np.isnan(self.measurements[:, 0])

    def without(self, ticks: IntArray) -> "Piece":
        """Return the piece without the measurements at some ticks."""
        values = self.measurements.copy()
        values[ticks] = np.nan
        return self._replace(measurements=values)

    def times(self, times: FloatArray) -> FloatArray:
        """Return the times (T,) of the ticks, NaN without a row, from those of the recording."""
        of_ticks = np.full(len(self.measurements), np.nan)
        of_ticks[self.ticks] = times[self.first : self.end] - self.late
        return of_ticks

    def split(self, borders: list[int]) -> "list[Piece]":
        """Return the pieces that begin at some ticks, of which the first is 0."""
        parts = []
        for first, end in pairwise([*borders, len(self.measurements)]):
            a, b = np.searchsorted(self.ticks, [first, end]).tolist()
            parts.append(
                Piece(
                    self.first + a,
                    self.first + b,
                    self.ticks[a:b] - first,
                    self.late[a:b],
                    self.measurements[first:end],
                    self.rates[first:end],
                )
            )
        return parts


class TickGrid(NamedTuple):
    """A recording on uniform ticks."""

    # Length of a tick [time unit].
    tau: float
    # Between gaps.
    pieces: tuple[Piece, ...]
    # Number of rows with a measurement that have no tick of their own.
    shared: int
    # Root mean square of the times by which rows were moved to their ticks, over tau.
    moved: float
    radar: Radar | None = None

    @property
    def total(self) -> int:
        """Number of ticks of all pieces."""
        return sum(len(piece.measurements) for piece in self.pieces)

    @property
    def longest(self) -> int:
        """Number of ticks of the longest piece."""
        return max(len(piece.measurements) for piece in self.pieces)

    @property
    def measured(self) -> int:
        """Number of ticks with a measurement."""
        return sum(int(piece.measured.sum()) for piece in self.pieces)

    @property
    def velocities(self) -> bool:
        """Whether velocities were measured."""
        return self.pieces[0].rates.shape[1] == 2

    def moving(self, times: FloatArray, velocity: FloatArray) -> "TickGrid":
        """Return the grid as seen from what moves with a velocity (2,), and was at 0 at time 0.

        Args:
            times: (n,) of the recording.
            velocity: (2,) of the observer.
        """
        pieces = [
            piece._replace(
                measurements=piece.measurements - velocity * piece.times(times)[:, None],
                rates=piece.rates - velocity if self.velocities else piece.rates,
            )
            for piece in self.pieces
        ]
        return self._replace(pieces=tuple(pieces))


def tick_grid(recording: Recording) -> TickGrid:
    """Put the rows of a recording on uniform ticks. `ArgumentError` if these would be more than 5
    million, because of a long gap, or if the steps in time or the extent of the positions are too
    small.
    """
    extent = float(np.ptp(recording.positions[recording.measured], axis=0).max())
    for name, value in {"step of the times": recording.tick, "extent": extent}.items():
        if 0.0 < value < 1e-30:
            raise reject(name, value, "at least 1e-30: choose a smaller unit")
    times_of = [recording.times[first:end] for first, end in recording.pieces]
    tau = _regular(times_of, recording.tick) or _irregular(times_of, recording.tick)
    pieces = []
    shared = 0
    squares = 0.0
    for (first, end), times in zip(recording.pieces, times_of, strict=True):
        numbers, late = clock_ticks(times, tau)
        measured = recording.measured[first:end]
        # A row without a tick of its own shares that of the row before.
        alone = np.diff(numbers, prepend=-1) > 0
        shared += int((measured & ~alone).sum())
        measured = measured & alone
        points = recording.positions[first:end][measured]
        measurements = np.full((int(numbers[-1]) + 1, 2), np.nan)
        measurements[numbers[measured]] = _moved(points, times[measured], late[measured])
        squares += float((late**2).sum())
        of_rows = np.empty((end - first, 0))
        if recording.rates is not None:
            of_rows = recording.rates[first:end]
        rates = np.full((len(measurements), of_rows.shape[1]), np.nan)
        rates[numbers[measured]] = of_rows[measured]
        pieces.append(Piece(first, end, numbers, late, measurements, rates))
    rows = sum(map(len, times_of))
    return TickGrid(
        tau, tuple(pieces), shared, float(np.sqrt(squares / rows)) / tau, recording.radar
    )


def clock_ticks(times: FloatArray, tau: float) -> tuple[IntArray, FloatArray]:
    """Return the tick of every time, from 0, and the time less that of its tick, (n,) each, as the
    clock of a live tracker gives them.
    """
    total = float(times[-1] - times[0]) / tau
    if total > MAX_TICKS:
        raise reject(
            "gap", f"{total:.3g} ticks of {tau:.3g}", f"a shorter gap: at most {MAX_TICKS:,} ticks"
        )
    ticks, late = np.ones(len(times)), np.zeros(len(times))
    run_compiled(_advance_all, times, tau, TickClock.gain, ticks, late)
    return np.cumsum(ticks).astype(int) - 1, late


def _regular(times_of: list[FloatArray], tick: float) -> float | None:
    """Return the tick of a clock that jitters: the slope of the times over the numbers of their
    ticks. None for a clock whose errors add up.
    """
    numbers = [np.zeros(len(times)) for times in times_of]
    for times, of_piece in zip(times_of, numbers, strict=True):
        run_compiled(_follow, times, tick, TickClock.gain, of_piece)
    # Of the rows of every piece, less their means.
    n, t = (
        np.concatenate([values - values.mean() for values in of_pieces])
        for of_pieces in (numbers, times_of)
    )
    weight = float(n @ n)
    tau = float(n @ t) / weight if weight else tick
    # Largest error of a row of a clock that jitters.
    return tau if np.abs(t - tau * n).max() <= 0.6 * tau else None


@compiled
def _advance_all(
    times: FloatArray, tau: float, gain: float, ticks: FloatArray, late: FloatArray
) -> None:
    """Write what the clock says of all times but the first one."""
    last, mean = times[0], 0.0
    for k in range(1, len(times)):
        ticks[k], late[k], last, mean = advance(times[k], last, mean, tau, gain)


@compiled
def _follow(times: FloatArray, tick: float, gain: float, numbers: FloatArray) -> None:
    """Write the number of ticks of every time since the first: the next one of a clock that is set
    forward or back by a part of its error after every row, so that neither jitter nor a tick that
    is not exactly known adds up.
    """
    clock = times[0]
    for k in range(1, len(times)):
        passed = max(round(min((times[k] - clock) / tick, MAX_TICKS)), 1)
        numbers[k] = numbers[k - 1] + passed
        clock += passed * tick
        clock += gain * (times[k] - clock)


def _irregular(times_of: list[FloatArray], tick: float) -> float:
    """Return the tick of irregular times: fine enough for few rows that share one."""
    # The median step divided by one of these.
    for divisor in (1, 2, 3, 4, 5, 8, 10):
        tau = tick / divisor
        numbers = [np.rint((times - times[0]) / tau) for times in times_of]
        shared = sum(len(of_piece) - len(np.unique(of_piece)) for of_piece in numbers)
        # Largest share of rows that fall on the tick of another one, if a divisor allows it.
        if shared <= 0.05 * sum(map(len, numbers)):
            break
    return tau


def _moved(points: FloatArray, times: FloatArray, late: FloatArray) -> FloatArray:
    """Return measurements, (n, 2), moved back by `late` along the local velocity."""
    rows = np.flatnonzero(late)
    # Measurements that give the local velocity.
    count = min(5, len(points))
    if not rows.size or count < 2:
        return points
    first = np.clip(rows - count // 2, 0, len(points) - count)
    window = first[:, None] + np.arange(count)
    t = times[window] - times[window].mean(1, keepdims=True)
    velocity = np.einsum("ak,akx->ax", t, points[window]) / (t**2).sum(1, keepdims=True)
    moved = points.copy()
    moved[rows] -= velocity * late[rows, None]
    return moved
