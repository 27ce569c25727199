"""What is compared with Kalman filters: filters with constant gains."""

import math

import numpy as np
from numpy.typing import ArrayLike

from studies.arrays import FloatArray
from studies.filters.motion_models import MotionModel
from studies.filters.track_filter import TrackFilter


class GHFilter(TrackFilter):
    """The g-h or alpha-beta filter of positions in d dimensions, [x, v] per axis, Sklansky 1957.
    With a third gain it is the g-h-k or alpha-beta-gamma filter, [x, v, a] per axis, Simpson 1963.

    With x, v and a the prediction at a measurement z, and t the time since the last measurement:
    x' = x + g (z - x), v' = v + h / t (z - x), a' = a + 2 k / t^2 (z - x), as Brookner 1998 writes
    the gains. Two-point start: a track has the position of its first measurement and no velocity;
    the second gives the position z_2 and the velocity (z_2 - z_1) / t. A track starts anew after
    `longest_gap` without a measurement [s].
    """

    covariance = None

    def __init__(
        self, axes: int, g: float, h: float, k: float | None = None, longest_gap: float = math.inf
    ):
        self.axes = axes
        self.motion = MotionModel("CV" if k is None else "CA", axes, noise=0.0)
        self.order = self.motion.order
        # Gain of each value at steps of one second, constant and at the second measurement.
        self.gains = np.array([g, h, 2.0 * (k or 0.0)][: self.order])
        self.start_gains = np.array([1.0, 1.0, 0.0][: self.order])
        self.longest_gap = longest_gap

    def begin(self, tracks: int) -> None:
        """See `TrackFilter.begin`."""
        self.state = np.full((tracks, self.motion.size), np.nan)
        self.log_likelihood = np.full(tracks, np.nan)
        # Measurements at different moments so far, and the time since the last one [s].
        self._count = np.zeros(tracks, int)
        self._elapsed = np.zeros(tracks)

    def predict(self, dt: float | FloatArray) -> None:
        """See `TrackFilter.predict`."""
        step = np.broadcast_to(dt, self.tracks)
        by_axis = self.state.reshape(self.tracks, self.axes, self.order)
        self.state = (by_axis @ self.motion.transition(step).mT).reshape(self.tracks, -1)
        self._elapsed = self._elapsed + step

    def update(self, measurement: ArrayLike, noise: FloatArray | None = None) -> None:
        """See `TrackFilter.update`."""
        values = np.asarray(measurement)
        measured = ~np.isnan(values[:, 0])
        begun = ~np.isnan(self.state[:, 0]) & (self._elapsed <= self.longest_gap)
        first = measured & ~begun
        later = measured & begun
        # Measurements of one moment tell nothing about the velocity.
        passed = later & (self._elapsed > 0.0)
        self._count = np.where(first, 1, self._count + passed)
        second = passed & (self._count == 2)
        per_second = 1.0 / np.where(self._elapsed > 0.0, self._elapsed, np.inf)
        gains = np.where(second[:, None], self.start_gains, self.gains)
        gains = gains * per_second[:, None] ** np.arange(self.order)
        innovation = values - self.position
        change = (innovation[:, :, None] * gains[:, None]).reshape(self.tracks, -1)
        self.state[later] += change[later]
        self.state[first] = 0.0
        self.state[first, :: self.order] = values[first]
        self._elapsed[measured] = 0.0
