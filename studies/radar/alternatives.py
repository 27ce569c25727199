"""What is compared with Kalman filters: a filter with constant gains, and correntropy."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from baselines import TrackFilter
from studies.radar.flights import FloatArray


class GHFilter(TrackFilter):
    """The g-h filter of positions in d dimensions, [x, v] per axis. Sklansky 1957.

    With x, v the prediction at a measurement z and t the time since the last one: x' = x + g (z -
    x), v' = v + h / t (z - x). Two-point start: a track has the position of its first measurement
    and no velocity; the second gives the position z_2 and the velocity (z_2 - z_1) / t. It starts
    anew after `longest_gap` without a measurement [s].
    """

    covariance = None
    order = 2

    def __init__(self, axes: int, g: float, h: float, longest_gap: float = math.inf):
        self.axes = axes
        self.g = g
        self.h = h
        self.longest_gap = longest_gap

    def begin(self, tracks: int) -> None:
        """See `TrackFilter.begin`."""
        self.state = np.full((tracks, 2 * self.axes), np.nan)
        self.log_likelihood = self.nis = np.full(tracks, np.nan)
        # Measurements at different moments so far, and the time since the last one [s].
        self._count = np.zeros(tracks, int)
        self._elapsed = np.zeros(tracks)

    def predict(self, dt: float | FloatArray) -> None:
        """See `TrackFilter.predict`."""
        step = np.broadcast_to(dt, self.tracks)
        self.state[:, ::2] += self.state[:, 1::2] * step[:, None]
        self._elapsed = self._elapsed + step

    def update(self, measurement: ArrayLike, noise: FloatArray | None = None) -> None:
        """See `TrackFilter.update`."""
        values = np.asarray(measurement)
        measured = ~np.isnan(values[:, 0])
        begun = ~np.isnan(self.state[:, 0]) & (self._elapsed <= self.longest_gap)
        first = measured & ~begun
        later = (measured & begun)[:, None]
        # Measurements of one moment tell nothing about the velocity.
        passed = measured & begun & (self._elapsed > 0.0)
        self._count = np.where(first, 1, self._count + passed)
        second = passed & (self._count == 2)
        per_second = 1.0 / np.where(self._elapsed > 0.0, self._elapsed, np.inf)
        gain = np.where(second, 1.0, self.g)[:, None]
        rate = (np.where(second, 1.0, self.h) * per_second)[:, None]
        innovation = values - self.position
        self.state[:, ::2] += np.where(later, gain * innovation, 0.0)
        self.state[:, 1::2] += np.where(later, rate * innovation, 0.0)
        self.state[first, ::2] = values[first]
        self.state[first, 1::2] = 0.0
        self._elapsed[measured] = 0.0


@dataclass(frozen=True)
class Correntropy:
    """Maximum of the correntropy of prediction and measurement, a robust correction of
    `KalmanFilter`. Chen, Liu, Zhao & Principe 2017, algorithm 1: residuals of both, in their
    standard deviations, have weights exp(-residual^2 / (2 width^2)), by fixed-point iterations. The
    covariance is that of the gain with the assumed variances; a large width gives the Kalman
    filter.
    """

    width: float

    def factors(
        self,
        innovation: FloatArray,
        predicted: FloatArray,
        variance: FloatArray,
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return corrections of state and covariance, and the log-likelihood, of innovations (B,)
        of variances predicted and measured, as the corrections of `baselines`.
        """
        # From the prediction on.
        gain = np.zeros_like(predicted)
        squares = innovation**2
        least = 1e-12
        scale = 2.0 * self.width**2
        for _ in range(10):
            of_prediction = np.exp(-squares * gain**2 / (scale * predicted))
            of_measurement = np.exp(-squares * (1.0 - gain) ** 2 / (scale * variance))
            ratio = np.maximum(of_measurement, least) / np.maximum(of_prediction, least)
            gain = predicted * ratio / (predicted * ratio + variance)
        state = gain / predicted
        total = predicted + variance / np.maximum(ratio, least)
        log_likelihood = -0.5 * (squares / total + np.log(2.0 * np.pi * total))
        return state, state * (2.0 - state * (predicted + variance)), log_likelihood
