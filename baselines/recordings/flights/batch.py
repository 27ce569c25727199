"""Several flights as arrays of the same length, so that filters run over all of them at once."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baselines.recordings.flights.flight import Flight

FloatArray = NDArray[np.float64]

NEIGHBOURS = 3  # positions before and after that give the velocity of the noise model


class Batch(NamedTuple):
    """B pieces of flights of at most T positions, padded at the end.

    Attributes:
        pieces: flight, first row and end of each piece.
        times: (T, B) [s]; the last one of a piece is repeated.
        positions: (T, B, 2) [m], NaN after its end.
        across: (B,) standard deviation of a position across the velocity [m].
        timing: (B,) standard deviation of its time [s].
    """

    pieces: tuple[tuple[int, int, int], ...]
    times: FloatArray
    positions: FloatArray
    across: FloatArray
    timing: FloatArray

    @property
    def present(self) -> NDArray[np.bool_]:
        """(T, B) False after the end of a piece."""
        return ~np.isnan(self.positions[..., 0])

    @property
    def steps(self) -> FloatArray:
        """(T, B) time since the last position [s], 0 for the first one."""
        return np.diff(self.times, axis=0, prepend=self.times[:1])


def stack_flights(flights: Sequence[Flight]) -> Batch:
    """Return the pieces of flights as one batch."""
    pieces = tuple((k, *piece) for k, flight in enumerate(flights) for piece in flight.pieces)
    total = max(end - first for _, first, end in pieces)
    times, positions = np.empty((total, len(pieces))), np.full((total, len(pieces), 2), np.nan)
    for column, (k, first, end) in enumerate(pieces):
        count = end - first
        times[:count, column], times[count:, column] = flights[k].times[first:end], flights[k].times[end - 1]
        positions[:count, column] = flights[k].positions[first:end]
    tiers = [flights[k].tier for k, _, _ in pieces]
    across, timing = np.array([[one.across, one.timing] for one in tiers]).T
    return Batch(pieces, times, positions, across, timing)


def local_velocities(batch: Batch) -> FloatArray:
    """Return the mean velocity (T, B, 2) [m/s] from three positions before to three after; 0 when padded."""
    total, tracks = batch.times.shape
    last = batch.present.sum(0) - 1
    rows = np.arange(total)[:, None]
    before, after = np.clip(rows - NEIGHBOURS, 0, last), np.clip(rows + NEIGHBOURS, 0, last)
    which = np.arange(tracks)
    moved = batch.positions[after, which] - batch.positions[before, which]
    passed = batch.times[after, which] - batch.times[before, which]
    return np.asarray(moved / np.where(passed > 0.0, passed, np.inf)[..., None])


def measurement_covariances(
    velocities: FloatArray, across: FloatArray | float, timing: FloatArray | float
) -> FloatArray:
    """Return across^2 I + timing^2 v v', (..., 2, 2) [m^2].

    Args:
        velocities: (..., 2) [m/s].
        across, timing: numbers or (...), see `Tier`.
    """
    along = (np.asarray(timing) ** 2)[..., None, None] * velocities[..., :, None] * velocities[..., None, :]
    return np.asarray((np.asarray(across) ** 2)[..., None, None] * np.eye(2) + along)
