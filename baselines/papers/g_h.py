"""Filters with gains and without a covariance, and the g-h (alpha-beta) filter, whose gains are constant.

Sklansky 1957; Benedict & Bordner 1962.
"""

from abc import abstractmethod

import numpy as np

from baselines.estimation.track_filter import TrackFilter
from hybrid_env.checks import FloatArray, check_integer, check_number, check_positive, reject


class GainFilter(TrackFilter):
    """A filter of [x, v] per axis with gains: no covariance and no likelihood.

    Two-point start: a track has the position of its first measurement and no velocity; the second gives the
    position z_2 and the velocity (z_2 - z_1) / t.

    Attributes:
        gains: (2, B, d) or (2, B, 1) of positions [-] and velocities [1/s] at the last measurement.
        longest_gap: time between two measurements [s] after which a track starts anew.
    """

    has_covariance = False
    covariance = None
    order = 2
    longest_gap = np.inf

    def _begin(self, tracks: int) -> None:
        self.state = np.full((tracks, 2 * self.axes), np.nan)
        self.log_likelihood = self.nis = np.full(tracks, np.nan)
        self.gains = np.full((2, tracks, self.axes), np.nan)
        self._count = np.zeros(tracks, np.int64)  # measurements at different moments so far
        self._elapsed = np.zeros(tracks)  # since the last one [s]

    def _set(self, state: FloatArray, covariance: FloatArray | None) -> None:
        self.state = state
        self._count[:] = 2

    def _predict(self, dt: float | FloatArray) -> None:
        step = np.broadcast_to(dt, self.tracks)
        self.state[:, ::2] += self.state[:, 1::2] * step[:, None]
        self._elapsed += step

    def _update(self, measurement: FloatArray, noise: FloatArray | None) -> None:
        measured = ~np.isnan(measurement[:, 0])
        begun = ~np.isnan(self.state[:, 0]) & (self._elapsed <= self.longest_gap)
        first, later = measured & ~begun, measured & begun
        passed = later & (self._elapsed > 0.0)  # measurements of one moment tell nothing about the velocity
        self._count = np.where(first, 1, self._count + passed)
        self.gains = self._find_gains(measurement)
        second = passed & (self._count == 2)
        self.gains[0, second], self.gains[1, second] = 1.0, 1.0 / self._elapsed[second, None]
        innovation = (measurement - self.state[:, ::2])[later]
        self.state[later, ::2] += self.gains[0, later] * innovation
        self.state[later, 1::2] += self.gains[1, later] * innovation
        self.state[first, ::2], self.state[first, 1::2] = measurement[first], 0.0
        self._elapsed[measured] = 0.0

    @abstractmethod
    def _find_gains(self, measurement: FloatArray) -> FloatArray:
        """Gains (2, B, d) or (2, B, 1) for the measurements (B, d) of a tick, NaN where there is none."""


class GHFilter(GainFilter):
    """The g-h filter of positions in d dimensions.

    With x, v the prediction at a measurement z and t the time since the last one:
    x' = x + g (z - x), v' = v + h / t (z - x). For its start see `GainFilter`. After a longer gap without
    measurements a track starts anew.

    Args:
        axes: number of dimensions d.
        g, h: gains, with 0 < g and 0 <= h, and h < 4 - 2 g, so that the filter is stable.
        longest_gap: time between two measurements [s] after which a track starts anew; None never.

    Raises:
        ArgumentError: an argument has a value that is not allowed.

    >>> gh = GHFilter(axes=1, g=0.5, h=0.2)
    >>> gh.begin(tracks=1)
    >>> for k in range(4):
    ...     gh.predict(2.0)
    ...     gh.update([[6.0 * k]])
    >>> gh.state
    array([[18.,  3.]])
    """

    def __init__(self, axes: int, g: float, h: float, longest_gap: float | None = None):
        self.axes = check_integer("axes", axes)
        self.g, self.h = check_positive("g", g), check_number("h", h)
        if not 0.0 <= self.h < 4.0 - 2.0 * self.g:
            raise reject("h", h, f"a number from 0, below 4 - 2 g = {4.0 - 2.0 * self.g:g}")
        self.longest_gap = np.inf if longest_gap is None else check_positive("longest_gap", longest_gap)

    def _find_gains(self, measurement: FloatArray) -> FloatArray:
        rate = self.h / np.where(self._elapsed > 0.0, self._elapsed, np.inf)
        return np.stack([np.full(self.tracks, self.g), rate])[..., None]
