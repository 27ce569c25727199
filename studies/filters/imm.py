"""The interacting multiple model (IMM) filter. Blom & Bar-Shalom 1988, "The interacting multiple
model algorithm for systems with Markovian switching coefficients". Logarithms of probabilities are
stored, so that none is lost in an outlier. Rows of a transition matrix sum to 1.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import logsumexp

from baselines import mixture
from studies.arrays import FloatArray
from studies.filters.kalman import KalmanFilter, resized
from studies.filters.track_filter import Moments, TrackFilter


class IMMFilter(TrackFilter):
    """The IMM filter of CV, CA and CJ models; turn rates, F, B and Q of your own and a transition
    matrix go to the bank of `modes=` and `transitions=` (`QuickestOptions`, `OnlineTracker`), and
    without mixing to `KalmanBank(modes=...)`.

    There is one Kalman filter per model, and a Markov chain of models in continuous time.

    The state has the size of the largest model; derivatives that a model lacks are 0 in it.
    Derivatives that two models share are mixed. One that only one of them has is distributed as at
    the start of a track, with mean 0 and the variance of its `start_deviations`: a variance of 0
    would make the filter blind to the first seconds of a manoeuvre (Granstrom, Willett & Bar-Shalom
    2015, "Systematic approach to IMM mixing for unequal dimension states").

    Args:
        filters: Kalman filters, plain or robust, with the same number of axes. A filter with more
            derivatives than another one needs `start_deviations`.
        sojourns: mean time in each model [s], one number or one per model, > 0. The next model is
            any of the others with equal probability.
    """

    # Smaller probabilities count as this one.
    smallest = 1e-300
    covariance: FloatArray

    def __init__(self, filters: Sequence[KalmanFilter], sojourns: float | ArrayLike):
        orders = [track_filter.order for track_filter in filters]
        self.filters = list(filters)
        count = len(filters)
        self.axes = filters[0].axes
        self.order = max(orders)
        times = np.broadcast_to(np.asarray(sojourns, float), count)
        self._stationary = times / times.sum()
        others = (np.ones((count, count)) - count * np.eye(count)) / (count - 1)
        # Eigenvalues and vectors of the rates of change [1/s], whose rows sum to 0.
        self._rates, self._vectors = np.linalg.eig(others / times[:, None])
        self._inverse = np.linalg.inv(self._vectors)

    @property
    def probabilities(self) -> FloatArray:
        """(B, M) of the models."""
        return np.exp(self._log_probabilities)

    def _estimates(self, order: int, variances: FloatArray | None) -> Moments:
        """Return the estimates of the models, (B, M, n) and (B, M, n, n), with the same number of
        values per axis, see `resized`.
        """
        parts = [
            resized(track_filter.state, track_filter.covariance, self.axes, order, variances)
            for track_filter in self.filters
        ]
        state, covariance = (np.stack(values, axis=1) for values in zip(*parts, strict=True))
        return state, covariance

    def begin(self, tracks: int) -> None:
        """See `TrackFilter.begin`."""
        for track_filter in self.filters:
            track_filter.begin(tracks)
        self._log_probabilities = np.tile(np.log(self._stationary), (tracks, 1))
        self._merge()

    def begin_from(self, state: ArrayLike, covariance: ArrayLike) -> None:
        """Forget everything and begin all tracks with estimates (B, n) and their covariances
        (n, n) or (B, n, n). Derivatives that a model lacks are not used.
        """
        mean = np.asarray(state, float)
        spread = np.broadcast_to(covariance, (*mean.shape, mean.shape[-1]))
        self.begin(len(mean))
        for track_filter in self.filters:
            track_filter.begin_from(*resized(mean, spread, self.axes, track_filter.order, None))
        self._merge()

    def transition(self, dt: float | FloatArray) -> FloatArray:
        """Transition matrix of the models, (M, M) or (B, M, M), in a time step [s] or (B,) of
        them.
        """
        powers = np.exp(self._rates * np.asarray(dt)[..., None])
        steps = (self._vectors * powers[..., None, :]) @ self._inverse
        return np.clip(np.real(steps), 0.0, 1.0)

    def predict(self, dt: float | FloatArray) -> None:
        """See `TrackFilter.predict`."""
        with np.errstate(divide="ignore"):
            # Before, after.
            joint = np.log(self.transition(dt)) + self._log_probabilities[:, :, None]
        after = logsumexp(joint, axis=1)
        # Weights of the filters before the step, in row j for model j.
        weights = np.exp(joint - after[:, None, :]).swapaxes(1, 2)
        mixed = [
            mixture(
                *self._estimates(track_filter.order, track_filter.start_variances),
                weights[:, j, None],
            )
            for j, track_filter in enumerate(self.filters)
        ]
        for track_filter, (state, covariance) in zip(self.filters, mixed, strict=True):
            track_filter.state = state[:, 0]
            track_filter.covariance = covariance[:, 0]
            track_filter.predict(dt)
        self._log_probabilities = np.maximum(after, np.log(self.smallest))
        self._merge()

    def update(self, measurement: ArrayLike, noise: FloatArray | None = None) -> None:
        """See `TrackFilter.update`."""
        for track_filter in self.filters:
            track_filter.update(measurement, noise)
        each = np.stack([track_filter.log_likelihood for track_filter in self.filters], axis=-1)
        joint = self._log_probabilities + each
        posterior = joint - logsumexp(joint, axis=1, keepdims=True)
        self._log_probabilities = np.maximum(posterior, np.log(self.smallest))
        self._merge()

    def _merge(self) -> None:
        """Compute mean and covariance of the mixture of all models."""
        estimates = self._estimates(self.order, None)
        state, covariance = mixture(*estimates, self.probabilities[:, None])
        self.state = state[:, 0]
        self.covariance = covariance[:, 0]
