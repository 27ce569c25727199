"""Estimates of the states of tracks, as filters and smoothers return them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Estimates:
    """Estimates for T ticks of B tracks in d dimensions. A single track has no axis B.

    Attributes:
        states: (T, B, n) estimates at each tick, NaN before a track begins.
        covariances: (T, B, n, n) of the estimates; None if there are none or they were not kept.
        order: number of values per axis of a state, m.
    """

    states: FloatArray
    covariances: FloatArray | None
    order: int

    @property
    def positions(self) -> FloatArray:
        """(T, B, d) [m]."""
        return self.states[..., :: self.order]

    @property
    def velocities(self) -> FloatArray:
        """(T, B, d) [m/s]."""
        return self.states[..., 1 :: self.order]
