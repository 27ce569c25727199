"""Kalman filters of the models CV, CA and CJ, plain or with a robust update. Kalman 1960."""

import numpy as np
from numpy.typing import ArrayLike

from baselines.estimation.correction import Robust, correct, principal_noise
from baselines.estimation.motion_models import MotionModel, check_per_item
from baselines.estimation.track_filter import TrackFilter, measurement_covariance
from hybrid_env.checks import FloatArray, IntArray, Moments, reject


class KalmanFilter(TrackFilter):
    """The Kalman filter of a kinematic model.

    A track that begins with its first measurement z has the position z with the covariance of the
    measurement, and derivatives 0 with the variances of `start_deviations`.

    Args:
        model: motion and process noise.
        noise: covariance of a measurement [m^2]: a variance, (d,) variances, or a matrix (d, d) or
            (B, d, d). With a robust update it is the covariance (of a Student-t the scale matrix)
            of good measurements.
        start_deviations: (m - 1,) standard deviations of velocity [m/s], acceleration [m/s^2] and
            jerk [m/s^3] at the start of a track. None if tracks begin with `begin_from`.
        robust: how measurements far from the prediction are used; None is the plain filter.
    """

    covariance: FloatArray

    def __init__(
        self,
        model: MotionModel,
        noise: float | ArrayLike,
        start_deviations: ArrayLike | None = None,
        robust: Robust | None = None,
    ):
        self.model = model
        self.robust = robust
        self.axes = model.axes
        self.order = model.order
        self.noise = measurement_covariance("noise", noise, self.axes)
        self._principal = principal_noise(self.noise)
        self.start_variances: FloatArray | None = None
        if start_deviations is not None:
            deviations = check_per_item("start_deviations", start_deviations, self.order - 1)
            self.start_variances = deviations**2
        # Matrices of the last time step, if it was equal for all tracks.
        self._step = np.nan, np.empty(0), np.empty(0)

    def _begin(self, tracks: int) -> None:
        size = self.model.size
        self.state = np.full((tracks, size), np.nan)
        self.covariance = np.full((tracks, size, size), np.nan)
        self._no_measurement()

    def _set(self, state: FloatArray, covariance: FloatArray | None) -> None:
        assert covariance is not None
        self.state = state
        self.covariance = covariance

    def _predict(self, dt: float | FloatArray) -> None:
        step = dt if isinstance(dt, float) else np.nan
        if self._step[0] != step:
            self._step = step, self.model.transition(dt), self.model.step_noise(dt)
        matrices = *self._step[1:], np.asarray(self.model.noise)
        self.state, self.covariance = propagate(self.state, self.covariance, *matrices)

    def _start(self, chosen: IntArray, measurement: FloatArray, noise: FloatArray) -> None:
        """Begin some tracks with their first measurements."""
        if self.start_variances is None:
            raise reject(
                "start_deviations",
                None,
                "numbers, or a start of all tracks by begin_from()",
            )
        noises = np.broadcast_to(noise, (self.tracks, *noise.shape[-2:]))[chosen]
        self.state[chosen], self.covariance[chosen] = resized(
            measurement[chosen],
            noises,
            self.axes,
            self.order,
            self.start_variances,
        )

    def _update(self, measurement: FloatArray, noise: FloatArray | None) -> None:
        noise = self.noise if noise is None else noise
        principal = self._principal if noise is self.noise else principal_noise(noise)
        self._no_measurement()
        measured = ~np.isnan(measurement[:, 0])
        begun = ~np.isnan(self.state[:, 0])
        used = measured & begun
        if used.all():
            results = correct(self.state, self.covariance, measurement, principal, self.robust)
            self.state, self.covariance, self.log_likelihood, self.nis = results
            return
        if used.any():
            self.state[used], self.covariance[used], self.log_likelihood[used], self.nis[used] = (
                correct(
                    self.state[used],
                    self.covariance[used],
                    measurement[used],
                    principal.of(used),
                    self.robust,
                )
            )
        first = np.flatnonzero(measured & ~begun)
        if first.size:
            self._start(first, measurement, noise)


def resized(
    state: FloatArray,
    covariance: FloatArray,
    axes: int,
    order: int,
    variances: FloatArray | None,
) -> Moments:
    """Return estimates (B, d m) and covariances with another number of values per axis, `order`.
    Derivatives that are left out are marginalized; new ones have the variances (order - 1,),
    velocity first, or are 0.
    """
    tracks, size = state.shape
    m = size // axes
    if m == order:
        return state, covariance
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
    state: FloatArray,
    covariance: FloatArray,
    transition: FloatArray,
    step_noise: FloatArray,
    intensity: FloatArray,
) -> Moments:
    """Return predicted estimates (..., n) and covariances F P F' + Q, (..., n, n). F and Q consist
    of d equal blocks of m values, one for each axis of CV, CA and CJ, given as (m, m) or (..., m,
    m), and Q has an intensity (d,) for each. A coordinated turn, whose axes depend on each other,
    has one block, and m = n.
    """
    size = state.shape[-1]
    m = transition.shape[-1]
    lead = state.shape[:-1]
    d = size // m
    half = times_transition(covariance, transition).swapaxes(-1, -2)
    full = times_transition(half, transition).reshape(*lead, d, m, d, m)
    for axis in range(d):
        full[..., axis, :, axis, :] += intensity[axis] * step_noise
    full = full.reshape(*lead, size, size)
    # Rounding errors that are not symmetric would grow in corrections along other axes than x and
    # y.
    return times_transition(state, transition), 0.5 * (full + full.swapaxes(-1, -2))


def times_transition(values: FloatArray, transition: FloatArray) -> FloatArray:
    """Return states F' or matrices P F', (..., n), for a transition F of equal blocks, see
    `propagate`.
    """
    m = transition.shape[-1]
    # Equal steps: one product.
    shape = (-1, m) if transition.ndim == 2 else (*transition.shape[:-2], -1, m)
    return (values.reshape(shape) @ transition.swapaxes(-1, -2)).reshape(values.shape)
