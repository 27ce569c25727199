"""Pieces of several flights as arrays of the same length, so that filters run over all of them at once."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


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

    def noise(self, velocities: FloatArray) -> FloatArray:
        """Return the covariances across^2 I + timing^2 v v' of positions, (..., B, 2, 2) [m^2].

        Args:
            velocities: (..., B, 2) v [m/s].
        """
        along = (self.timing**2)[:, None, None] * velocities[..., :, None] * velocities[..., None, :]
        return np.asarray((self.across**2)[:, None, None] * np.eye(2) + along)
