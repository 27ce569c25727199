"""The g-h filter (alpha-beta filter): constant gains. Sklansky 1957; Benedict & Bordner 1962."""

import numpy as np
from numpy.typing import NDArray

from baselines.estimation.track_filter import TrackFilter
from hybrid_env.checks import check_integer, check_number, check_positive, reject

FloatArray = NDArray[np.float64]


class GHFilter(TrackFilter):
    """The g-h filter of positions in d dimensions.

    With x, v the prediction at a measurement z and t the time since the last one:
    x' = x + g (z - x), v' = v + h / t (z - x).

    Two-point start: a track has the position of its first measurement and no velocity; the second gives the
    position z_2 and the velocity (z_2 - z_1) / t. After a longer gap without measurements a track starts
    anew. The filter has no covariance and no likelihood.

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

    has_covariance = False
    order = 2
    covariance = None

    def __init__(self, axes: int, g: float, h: float, longest_gap: float | None = None):
        self.axes = check_integer("axes", axes)
        self.g, self.h = check_positive("g", g), check_number("h", h)
        if not 0.0 <= self.h < 4.0 - 2.0 * self.g:
            raise reject("h", h, f"a number from 0, below 4 - 2 g = {4.0 - 2.0 * self.g:g}")
        self.longest_gap = np.inf if longest_gap is None else check_positive("longest_gap", longest_gap)

    def _begin(self, tracks: int) -> None:
        self.state = np.full((tracks, 2 * self.axes), np.nan)
        self.log_likelihood = self.nis = np.full(tracks, np.nan)
        self._elapsed = np.zeros(tracks)  # since the last measurement [s]
        self._moving = np.zeros(tracks, np.bool_)  # whether the velocity is known

    def _set(self, state: FloatArray, covariance: FloatArray | None) -> None:
        self.state = state
        self._moving[:] = True

    def _predict(self, dt: float | FloatArray) -> None:
        step = np.broadcast_to(dt, self.tracks)
        self.state[:, ::2] += self.state[:, 1::2] * step[:, None]
        self._elapsed += step

    def _update(self, measurement: FloatArray, noise: FloatArray | None) -> None:
        measured = ~np.isnan(measurement[:, 0])
        begun = ~np.isnan(self.state[:, 0]) & (self._elapsed <= self.longest_gap)
        first, later = measured & ~begun, measured & begun
        self.state[first, ::2], self.state[first, 1::2] = measurement[first], 0.0
        self._moving[first] = False
        residual = (measurement - self.state[:, ::2])[later]
        elapsed, moving = self._elapsed[later], self._moving[later]
        passed = elapsed > 0.0  # measurements of the same moment tell nothing about the velocity
        second = passed & ~moving
        g = np.where(second, 1.0, self.g)
        rate = np.where(second, 1.0, self.h) / np.where(passed, elapsed, np.inf)
        self.state[later, ::2] += g[:, None] * residual
        self.state[later, 1::2] += rate[:, None] * residual
        self._moving[later] |= passed
        self._elapsed[measured] = 0.0
