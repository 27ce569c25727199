"""What is compared with Kalman filters: filters whose gains are constant, or identified from their
innovations.
"""

import math

import numpy as np

from studies.arrays import BoolArray, FloatArray
from studies.filters.track_filter import TrackFilter


class GHFilter(TrackFilter):
    """The g-h or alpha-beta filter of positions in d dimensions, [x, v] per axis, Sklansky 1957.

    With x and v the prediction at a measurement z, and t the time since the last measurement:
    x' = x + g (z - x), v' = v + h / t (z - x), as Brookner 1998 writes the gains. Two-point start:
    a track has the position of its first measurement and no velocity; the second gives the position
    z_2 and the velocity (z_2 - z_1) / t. A track starts anew after `longest_gap` without a
    measurement [s].
    """

    covariance = None
    order = 2

    def __init__(self, axes: int, g: float, h: float, longest_gap: float = math.inf):
        self.axes = axes
        # Of position and velocity, at steps of one second.
        self.gains = np.array([g, h])
        self.longest_gap = longest_gap

    def begin(self, tracks: int) -> None:
        """See `TrackFilter.begin`."""
        self.state = np.full((tracks, 2 * self.axes), np.nan)
        # Measurements at different moments so far, and the time since the last one [s].
        self._count = np.zeros(tracks, int)
        self._elapsed = np.zeros(tracks)

    def predict(self, dt: float | FloatArray) -> None:
        """See `TrackFilter.predict`."""
        self.state[:, ::2] += np.asarray(dt)[..., None] * self.state[:, 1::2]
        self._elapsed += dt

    def update(self, measurement: FloatArray, noise: FloatArray | None = None) -> None:
        """See `TrackFilter.update`."""
        measured = ~np.isnan(measurement[:, 0])
        begun = ~np.isnan(self.state[:, 0]) & (self._elapsed <= self.longest_gap)
        first = measured & ~begun
        later = measured & begun
        # Measurements of one moment tell nothing about the velocity.
        passed = later & (self._elapsed > 0.0)
        self._count = np.where(first, 1, self._count + passed)
        per_second = 1.0 / np.where(self._elapsed > 0.0, self._elapsed, np.inf)
        innovation = measurement - self.position
        gains = self.find_gains(passed, innovation)
        gains = gains * per_second[:, None, None] ** np.arange(2)
        change = (innovation[:, :, None] * gains).reshape(self.tracks, -1)
        self.state[later] += change[later]
        self.state[first] = 0.0
        self.state[first, ::2] = measurement[first]
        self._elapsed[measured] = 0.0

    def find_gains(self, passed: BoolArray, innovation: FloatArray) -> FloatArray:
        """Return the gains of position and velocity at steps of one second, (B, 1 or d, 2).

        Args:
            passed: (B,) whether a track goes on with a measurement of another moment.
            innovation: (B, d) [m], of any value for the other tracks.
        """
        second = passed & (self._count == 2)
        return np.where(second[:, None, None], 1.0, self.gains)


class AdaptiveFilter(GHFilter):
    """The adaptive filter of positions, [x, v] per axis, Zimchuk & Kankin 2006. It has no model of
    the noises.

    Its gains are identified from the innovations nu and the third backward differences D^3 of the
    predictions x_e, v_e, by eqs. (5) and (17). With nu_i the innovation i measurements ago, T the
    time since the last one, and the mean M over the measurements so far,

        g = M[(3 nu_1 - 3 nu_2 + nu_3 - D^3 x_e) nu] / M[nu nu]
        h = M[(3 nu_1 - 6 nu_2 + 4 nu_3 - nu_4 - T D^3 v_e) nu] / M[nu nu]

    Up to ten products the gains are those of a line fit. If `limited`, which the paper does not
    state, they are those of a stable filter, 0 <= g <= 1 and 0 <= h <= g^2 / (2 - g). With a
    `memory` M is an exponential mean over this number of measurements.
    """

    def __init__(
        self,
        axes: int,
        memory: float = math.inf,
        limited: bool = True,
        longest_gap: float = math.inf,
    ):
        super().__init__(axes, math.nan, math.nan, longest_gap)
        self.memory, self.limited = memory, limited

    def begin(self, tracks: int) -> None:
        """See `TrackFilter.begin`."""
        super().begin(tracks)
        # nu, x_e and v_e of the last five measurements, the newest first.
        self._last = np.full((5, 3, tracks, self.axes), np.nan)
        self._means = np.zeros((3, tracks, self.axes))
        # Products in the means.
        self._products = np.zeros(tracks)

    def find_gains(self, passed: BoolArray, innovation: FloatArray) -> FloatArray:
        """See `GHFilter.find_gains`."""
        anew = self._count < 2
        self._last[:, :, anew], self._means[:, anew], self._products[anew] = np.nan, 0.0, 0.0
        newest = np.stack([innovation, self.position, self.state[:, 1::2]])
        self._last[:, :, passed] = np.stack([newest, *self._last[:-1]])[:, :, passed]
        nu = self._last[:, 0]
        third = np.tensordot([1.0, -3.0, 3.0, -1.0, 0.0], self._last, 1)
        of_position = np.tensordot([0.0, 3.0, -3.0, 1.0, 0.0], nu, 1) - third[1]
        of_velocity = np.tensordot([0.0, 3.0, -6.0, 4.0, -1.0], nu, 1)
        of_velocity -= self._elapsed[:, None] * third[2]
        products = np.stack([innovation, of_position, of_velocity]) * innovation
        known = passed & ~np.isnan(products).any((0, 2))
        self._products += known
        weight = known / np.clip(self._products, 1.0, self.memory)
        self._means += weight[:, None] * np.nan_to_num(products - self._means)
        n = np.maximum(self._count, 2)[:, None]
        of_line = 2.0 * (2.0 * n - 1.0) / (n * (n + 1.0)), 6.0 / (n * (n + 1.0))
        identified = (self._products > 10)[:, None]
        spread = np.where(identified, self._means[0], 1.0)
        g, h = np.where(identified, self._means[1:] / spread, of_line)
        if self.limited:
            g = np.clip(g, 0.0, 1.0)
            h = np.clip(h, 0.0, g**2 / (2.0 - g))
        return np.stack([g, h], axis=-1)
