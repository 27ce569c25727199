"""Filters with gains: the g-h filter, and the adaptive one of Zimchuk & Kankin 2006, as
published and corrected.

The g-h (alpha-beta) filter has constant gains (Sklansky 1957; Benedict & Bordner 1962). The
adaptive filter has the constant-velocity prediction of a Kalman filter, but no model of its noises:
the gain K = P_e C' (C P_e C' + R)^-1, eq. (5), is identified from the innovations nu and the N-th
backward differences D^N of the predictions x_e. With N = 3 and H_i = M[nu_(n-i) nu_n'], where M is
a mean over time (the paper prints nu_n nu_(n-i)', the same for one axis):

    C P_e C'        = -M[D^3 x_e nu'] + 3 H_1 - 3 H_2 + H_3                   eq. (17), positions
    F P_e C'        = -M[D^3 v_e nu'] + (3 H_1 - 6 H_2 + 4 H_3 - H_4) / T     eq. (17), velocities
    R               =  M[(D^3 nu + D^3 x_e) nu']                              eq. (19)

Added up, C P_e C' + R = H_0, so that the gain of the positions is I - R H_0^-1 (`published_gain`).
The paper does not say what M, the start and the limits of the gain are. Here: each axis is filtered
by itself, M is the mean over all ticks so far, the first gains are those of a line fit, and the
gains are limited to those of a stable filter. Eq. (17) takes the covariance of successive
prediction errors for that of successive innovations, and eq. (19) is biased, because the innovation
contains earlier noise too.

The corrected filter keeps the identity and takes both of its terms from means that are not biased:
the third difference of the measurements has the variance (1 + 9 + 9 + 1) R if the motion is smooth,
and H_0 is the mean square of the last innovations. The gain of the velocities is h = g^2 / (2 - g)
of that of the positions (Benedict & Bordner 1962).
"""

import math

import numpy as np

from baselines.estimation.track_filter import TrackFilter
from hybrid_env.checks import (
    FloatArray,
    Positive,
    check_flag,
    check_integer,
    check_number,
    checked,
    reject,
)


class GHFilter(TrackFilter):
    """The g-h filter of positions in d dimensions, [x, v] per axis.

    With x, v the prediction at a measurement z and t the time since the last one: x' = x + g (z -
    x), v' = v + h / t (z - x). The gains have 0 < g and 0 <= h < 4 - 2 g, so that the filter is
    stable. Two-point start: a track has the position of its first measurement and no velocity; the
    second gives the position z_2 and the velocity (z_2 - z_1) / t. It starts anew after
    `longest_gap` without a measurement [s]; None never.
    """

    covariance = None
    order = 2
    longest_gap = np.inf

    def __init__(self, axes: int, g: float, h: float, longest_gap: float | None = None):
        self.axes = check_integer("axes", axes)
        self.g = checked("g", g, Positive)
        bound = 4.0 - 2.0 * g
        self.h = check_number(
            "h",
            h,
            f"a number from 0, below 4 - 2 g = {bound:g}",
            0.0,
            math.nextafter(bound, -1.0),
        )
        self.longest_gap = checked("longest_gap", longest_gap, Positive | None) or np.inf

    def _begin(self, tracks: int) -> None:
        self.state = np.full((tracks, 2 * self.axes), np.nan)
        self.log_likelihood = self.nis = np.full(tracks, np.nan)
        self.gains = np.full((2, tracks, self.axes), np.nan)
        # Measurements at different moments so far.
        self._count = np.zeros(tracks, int)
        # Since the last one [s].
        self._elapsed = np.zeros(tracks)

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
        first = measured & ~begun
        later = measured & begun
        # Measurements of one moment tell nothing about the velocity.
        passed = later & (self._elapsed > 0.0)
        self._count = np.where(first, 1, self._count + passed)
        self.gains = self._find_gains(measurement)
        second = passed & (self._count == 2)
        self.gains[0, second] = 1.0
        self.gains[1, second] = 1.0 / self._elapsed[second, None]
        innovation = (measurement - self.state[:, ::2])[later]
        self.state[later, ::2] += self.gains[0, later] * innovation
        self.state[later, 1::2] += self.gains[1, later] * innovation
        self.state[first, ::2] = measurement[first]
        self.state[first, 1::2] = 0.0
        self._elapsed[measured] = 0.0

    def _find_gains(self, measurement: FloatArray) -> FloatArray:
        """Gains (2, B, d) or (2, B, 1) for the measurements (B, d) of a tick, NaN where there is
        none.
        """
        rate = self.h / np.where(self._elapsed > 0.0, self._elapsed, np.inf)
        return np.stack([np.full(self.tracks, self.g), rate])[..., None]


# Coefficients of the third backward difference D^3, newest value first.
DIFFERENCE = np.array([1.0, -3.0, 3.0, -1.0])


def third_difference(values: FloatArray) -> FloatArray:
    """Return D^3 of a sequence, newest value first, (4, ...) or more."""
    return np.tensordot(DIFFERENCE, values[:4], axes=1)


def products(position: FloatArray, velocity: FloatArray, innovation: FloatArray) -> FloatArray:
    """Products whose means identify the gain, (8, ...): H_0 to H_4, then D^3 x_e nu, D^3 v_e nu and
    D^3 nu nu, of the last four predictions [m, m/s] and five innovations [m], newest first.
    """
    differences = [third_difference(values) for values in (position, velocity, innovation)]
    return np.stack([*innovation[:5], *differences]) * innovation[0]


def published_gain(means: FloatArray, tau: float) -> tuple[FloatArray, FloatArray]:
    """Gains of positions [-] and velocities [1/s] without limits, eq. (5), (17) and (19), of
    means (8, ...).
    """
    _, h1, h2, h3, h4, position, velocity, innovation = means
    position_spread = -position + 3.0 * h1 - 3.0 * h2 + h3
    velocity_spread = -velocity + (3.0 * h1 - 6.0 * h2 + 4.0 * h3 - h4) / tau
    noise = innovation + position
    total = position_spread + noise
    return position_spread / total, velocity_spread / total


def shifted(history: FloatArray, newest: FloatArray) -> FloatArray:
    """The history, newest first, with one more value in the place of the oldest."""
    return np.concatenate([newest[None], history[:-1]])


class AdaptiveFilter(GHFilter):
    """The adaptive filter as published, each axis by itself, for equal time steps.

    Its gains depend on past innovations. Until it adapts it has those of a line fitted to n
    measurements, K_1 = 2 (2 n - 1) / (n (n + 1)) and K_2 = 6 / (n (n + 1) T). Products of ticks
    around a missing measurement are left out of the means.

    Args:
        axes: number of dimensions d.
        tau: length of a tick [s].
        limited: limits the gains to 0 <= K_1 <= 1 and 0 <= K_2 <= K_1^2 / ((2 - K_1) T), which the
            paper does not state. Without limits its estimates are worse than the measurements.
    """

    def __init__(self, axes: int, tau: float, *, limited: bool = True):
        self.axes = check_integer("axes", axes)
        self.tau = checked("tau", tau, Positive)
        self.limited = check_flag("limited", limited)

    def _begin(self, tracks: int) -> None:
        super()._begin(tracks)
        # Of H_0 to H_4.
        self._history = np.full((3, 5, tracks, self.axes), np.nan)
        self._means = np.zeros((8, tracks, self.axes))
        self._products = np.zeros((tracks, self.axes))

    def _predict(self, dt: float | FloatArray) -> None:
        step = np.asarray(dt)
        wrong = np.abs(step - self.tau) > 1e-6 * self.tau
        if (wrong & (self._count > 0)).any():
            raise reject(
                "dt",
                float(step.flat[0]),
                f"the length of a tick, {self.tau:g}, in every step",
            )
        super()._predict(self.tau)

    def _find_gains(self, measurement: FloatArray) -> FloatArray:
        n = np.maximum(self._count, 2)[:, None]
        line = np.stack([2.0 * (2 * n - 1) / (n * (n + 1)), 6.0 / (n * (n + 1) * self.tau)])
        adapted = self._adapted(measurement)
        return np.where(np.isnan(adapted), line, adapted)

    def _adapted(self, measurement: FloatArray) -> FloatArray:
        """Gains (2, B, d) after prediction and measurement of a tick, (B, d); NaN where it does
        not adapt yet.
        """
        values = (self.position, self.velocity, measurement - self.position)
        self._history = np.stack(
            [shifted(*pair) for pair in zip(self._history, values, strict=True)]
        )
        new = products(*self._history)
        known = ~np.isnan(new).any(axis=0)
        self._products += known
        change = known / np.maximum(self._products, 1.0) * (new - self._means)
        self._means = self._means + np.where(np.isnan(change), 0.0, change)
        ready = self._products > 10
        means = self._means[:, ready]
        gains = np.full((2, *ready.shape), np.nan)
        # Innovations of exactly 0 identify nothing.
        means = np.where(means[0] == 0.0, np.nan, means)
        gains[:, ready] = published_gain(means, self.tau)
        if self.limited:
            gains[0] = np.clip(gains[0], 0.0, 1.0)
            gains[1] = np.clip(gains[1], 0.0, gains[0] ** 2 / ((2.0 - gains[0]) * self.tau))
        return gains


class CorrectedAdaptiveFilter(AdaptiveFilter):
    """The adaptive filter with estimates of R and H_0 that are not biased, and one gain for all
    axes, from their means.

    It adapts after two windows of H_0, of 15 innovations. A short window would follow a manoeuvre
    faster, a long one have a steadier gain. The gain K_1 = 1 - R / H_0 is limited to 0.12 to 0.9.
    """

    window = 15

    def _begin(self, tracks: int) -> None:
        super()._begin(tracks)
        self._measurements = np.full((4, tracks, self.axes), np.nan)
        # Of innovations, mean over the axes.
        self._squares = np.full((self.window, tracks), np.nan)
        self._noise = np.zeros(tracks)
        self._differences = np.zeros(tracks)

    def _adapted(self, measurement: FloatArray) -> FloatArray:
        innovation = measurement - self.position
        self._measurements = shifted(self._measurements, measurement)
        new = (third_difference(self._measurements) ** 2).mean(-1) / (DIFFERENCE**2).sum()
        known = ~np.isnan(new)
        self._differences += known
        self._noise += np.where(known, new - self._noise, 0.0) / np.maximum(self._differences, 1.0)
        later = shifted(self._squares, (innovation**2).mean(-1))
        self._squares = np.where(np.isnan(innovation[:, 0]), self._squares, later)
        # NaN until the window is full.
        mean = self._squares.mean(0)
        ready = (self._count > 2 * self.window) & (mean > 0.0)
        ratio = self._noise / np.where(ready, mean, 1.0)
        gain = np.clip(1.0 - ratio, 0.12, 0.9)
        gains = np.stack([gain, gain**2 / ((2.0 - gain) * self.tau)])
        return np.where(ready, gains, np.nan)[..., None].repeat(self.axes, axis=-1)
