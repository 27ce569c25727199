"""Kalman filters of the models CV, CA and CJ, plain or with a robust update. Kalman 1960."""

import numpy as np
from numpy.typing import ArrayLike

from studies.arrays import BoolArray, FloatArray
from studies.filters.correction import StudentT, correct
from studies.filters.motion_models import MotionModel
from studies.filters.track_filter import Moments, TrackFilter


class KalmanFilter(TrackFilter):
    """The Kalman filter of a kinematic model.

    A track that begins with its first measurement z has the position z with the covariance of the
    measurement, and derivatives 0 with the variances of `start_deviations`.

    Args:
        model: motion and process noise.
        noise: covariance of a measurement [m^2]: a variance, (d,) variances, or a matrix (d, d).
            With a robust update it is the covariance (of a Student-t the scale matrix) of good
            measurements.
        start_deviations: (m - 1,) standard deviations of velocity [m/s], acceleration [m/s^2] and
            jerk [m/s^3] at the start of a track. None if tracks begin with `begin_from`.
        robust: how measurements far from the prediction are used; None is the plain filter.
    """

    covariance: FloatArray
    # (B,) of the last measurement given those before; 0 without a measurement and for the one that
    # begins a track.
    log_likelihood: FloatArray

    def __init__(
        self,
        model: MotionModel,
        noise: float | ArrayLike,
        start_deviations: ArrayLike | None = None,
        robust: StudentT | None = None,
    ):
        self.model = model
        self.robust = robust
        self.axes = model.axes
        self.order = model.order
        values = np.asarray(noise, float)
        self.noise: FloatArray = values if values.ndim == 2 else values * np.eye(self.axes)
        # Variances and axes of independent components of a measurement.
        self._components = np.linalg.eigh(self.noise)
        self.start_variances = None if start_deviations is None else np.square(start_deviations)

    def begin(self, tracks: int) -> None:
        """See `TrackFilter.begin`."""
        self.state = np.full((tracks, self.model.size), np.nan)
        self.covariance = np.full((tracks, self.model.size, self.model.size), np.nan)
        self.log_likelihood = np.zeros(self.tracks)

    def begin_from(self, state: ArrayLike, covariance: ArrayLike) -> None:
        """Forget everything and begin all tracks with estimates (B, n), and their covariances
        (n, n) or (B, n, n).
        """
        self.state = np.array(state, float)
        shape = (self.tracks, self.model.size, self.model.size)
        self.covariance = np.array(np.broadcast_to(covariance, shape), float)
        self.log_likelihood = np.zeros(self.tracks)

    def predict(self, dt: float | FloatArray) -> None:
        """See `TrackFilter.predict`."""
        self.state, self.covariance = propagate(self.model, self.state, self.covariance, dt)

    def update(self, measurement: ArrayLike, noise: FloatArray | None = None) -> None:
        """See `TrackFilter.update`."""
        size = self.tracks, self.axes
        values = np.asarray(measurement, float)
        variances, axes = self._components if noise is None else np.linalg.eigh(noise)
        variances = np.broadcast_to(variances, size)
        axes = np.broadcast_to(axes, (*size, self.axes))
        self.log_likelihood = np.zeros(self.tracks)
        measured = ~np.isnan(values).any(1)
        begun = ~np.isnan(self.state[:, 0])
        used = measured & begun
        results = correct(
            self.state[used],
            self.covariance[used],
            values[used],
            variances[used],
            axes[used],
            self.robust,
        )
        self.state[used], self.covariance[used], self.log_likelihood[used] = results
        if (measured & ~begun).any():
            self._start(measured & ~begun, values, self.noise if noise is None else noise)

    def _start(self, chosen: BoolArray, measurement: FloatArray, noise: FloatArray) -> None:
        """Begin some tracks, (B,), with their first measurements (B, d)."""
        noises = np.broadcast_to(noise, (self.tracks, self.axes, self.axes))
        self.state[chosen], self.covariance[chosen] = resized(
            measurement[chosen], noises[chosen], self.axes, self.order, self.start_variances
        )


def resized(
    state: FloatArray, covariance: FloatArray, axes: int, order: int, variances: FloatArray | None
) -> Moments:
    """Return estimates (B, d m) and covariances with another number of values per axis, `order`.
    Derivatives that are left out are marginalized; new ones have the variances (order - 1,),
    velocity first, or are 0.
    """
    tracks, size = state.shape
    m = size // axes
    common = min(m, order)
    mean = np.zeros((tracks, axes, order))
    mean[:, :, :common] = state.reshape(tracks, axes, m)[:, :, :common]
    matrix = np.zeros((tracks, axes, order, axes, order))
    matrix[:, :, :common, :, :common] = covariance.reshape(tracks, axes, m, axes, m)[
        :, :, :common, :, :common
    ]
    if variances is not None:
        each = np.arange(axes)
        for k in range(common, order):
            matrix[:, each, k, each, k] = variances[k - 1]
    return mean.reshape(tracks, -1), matrix.reshape(tracks, axes * order, axes * order)


def propagate(
    model: MotionModel, state: FloatArray, covariance: FloatArray, dt: float | FloatArray
) -> Moments:
    """Return predicted estimates (..., n) and covariances F P F' + Q, (..., n, n), after a time
    step [s], one number or (...).
    """
    transition, noise = model.matrices(dt)
    predicted = transition @ covariance @ transition.mT + noise
    # Rounding errors that are not symmetric would grow.
    return (transition @ state[..., None])[..., 0], 0.5 * (predicted + predicted.mT)
