"""The interacting multiple model (IMM) filter, and its steps for filters of any kind. Blom &
Bar-Shalom 1988, "The interacting multiple model algorithm for systems with Markovian switching
coefficients". Logarithms of probabilities are stored, so that none is lost in an outlier. Rows of a
transition matrix sum to 1.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from baselines.estimation.kalman import KalmanFilter, resized
from baselines.estimation.motion_models import check_per_item
from baselines.estimation.track_filter import TrackFilter
from hybrid_env.checks import FloatArray, check_array, check_covariance, reject

# Smaller probabilities count as this one.
SMALLEST = 1e-300


class ModelChain:
    """The Markov chain of models in continuous time, from rates of change (M, M) [1/s], whose
    rows sum to 0.
    """

    def __init__(self, generator: FloatArray):
        self._values, self._vectors = np.linalg.eig(generator)
        self._inverse = np.linalg.inv(self._vectors)

    def transition(self, dt: float | FloatArray) -> FloatArray:
        """Transition matrix of the models, (M, M) or (B, M, M), in a time step [s] or (B,) of
        them.
        """
        powers = np.exp(self._values * np.asarray(dt)[..., None])
        return np.clip(np.real((self._vectors * powers[..., None, :]) @ self._inverse), 0.0, 1.0)


def mix_models(
    log_probability: FloatArray,
    transition: FloatArray,
    smallest: float,
) -> tuple[FloatArray, FloatArray]:
    """Return log probabilities (B, M) after a step of the chain, at least `smallest`, and weights
    (B, M, M), whose row j mixes the filters before the step for model j.
    """
    with np.errstate(divide="ignore"):
        # Before, after.
        joint = np.log(transition) + log_probability[:, :, None]
    after = log_sum(joint, 1)
    weights = np.exp(joint - after[:, None, :])
    return np.maximum(after, np.log(smallest)), weights.swapaxes(1, 2)


def weigh_models(
    log_prior: FloatArray,
    log_likelihood: FloatArray,
    smallest: float,
) -> tuple[FloatArray, FloatArray]:
    """Return the log posterior of the models, (B, M), at least `smallest`, and the
    log-likelihood of all, (B,).
    """
    joint = log_prior + log_likelihood
    total = log_sum(joint, 1)
    return np.maximum(joint - total[:, None], np.log(smallest)), total


def mixture(
    state: FloatArray,
    covariance: FloatArray,
    weights: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return mean and covariance of C mixtures, (B, C, n) and (B, C, n, n), of the same K normal
    distributions, (B, K, n) and (B, K, n, n), with weights (B, C, K).
    """
    mean = weights @ state
    # Sum of w (P + x x') less m m', with states relative to one of them, because positions are
    # large.
    relative = state - state[:, :1]
    centre = mean - state[:, :1]
    square = covariance + relative[..., :, None] * relative[..., None, :]
    tracks, count, size = state.shape
    mixed = (weights @ square.reshape(tracks, count, size * size)).reshape(*mean.shape, size)
    return mean, mixed - centre[..., :, None] * centre[..., None, :]


def squared_innovation(innovation: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return squares (B,) of innovations (B, d) in units of their covariances (B, d, d); NaN
    without one.
    """
    used = ~np.isnan(innovation).any(1)
    nis = np.full(len(innovation), np.nan)
    solved = np.linalg.solve(covariance[used], innovation[used][..., None])[..., 0]
    nis[used] = (innovation[used] * solved).sum(-1)
    return nis


def log_sum(logarithms: FloatArray, axis: int) -> FloatArray:
    """Return logarithms of sums of numbers along an axis, without overflow; of nothing but zeros
    -inf.
    """
    largest = logarithms.max(axis, keepdims=True)
    finite = np.where(np.isinf(largest), 0.0, largest)
    with np.errstate(divide="ignore"):
        total = np.log(np.exp(logarithms - finite).sum(axis, keepdims=True)) + finite
    return np.asarray(total.squeeze(axis))


class IMMFilter(TrackFilter):
    """The IMM filter: one Kalman filter per model, and a Markov chain of models in continuous time.

    The state has the size of the largest model; derivatives that a model lacks are 0 in it.
    Derivatives that two models share are mixed. One that only one of them has is distributed as at
    the start of a track, with mean 0 and the variance of its `start_deviations`: a variance of 0
    would make the filter blind to the first seconds of a manoeuvre (Granstrom, Willett & Bar-Shalom
    2015, "Systematic approach to IMM mixing for unequal dimension states"). `nis` is that of the
    merged prediction.

    Args:
        filters: Kalman filters, plain or robust, with the same number of axes. A filter with more
            derivatives than another one needs `start_deviations`.
        sojourns: mean time in each model [s], one number or one per model, > 0. The next model is
            any of the others with equal probability.
    """

    covariance: FloatArray

    def __init__(self, filters: Sequence[KalmanFilter], sojourns: float | ArrayLike):
        known = isinstance(filters, Sequence) and all(
            isinstance(one, KalmanFilter) for one in filters
        )
        if not known or len(filters) < 2 or len({one.axes for one in filters}) > 1:
            raise reject(
                "filters",
                filters,
                "two or more KalmanFilters with the same number of axes",
            )
        orders = [one.order for one in filters]
        for one in filters:
            if one.order > min(orders) and one.start_variances is None:
                raise reject("filters", one.model.name, "start_deviations of the larger models")
        self.filters, self.axes, self.order, count = (
            list(filters),
            filters[0].axes,
            max(orders),
            len(filters),
        )
        times = check_per_item("sojourns", sojourns, count, smallest=1e-30)
        self._stationary = times / times.sum()
        others = (np.ones((count, count)) - count * np.eye(count)) / (count - 1)
        self._chain = ModelChain(others / times[:, None])

    @property
    def probabilities(self) -> FloatArray:
        """(B, M) of the models."""
        return np.exp(self._log_probabilities)

    @property
    def estimates(self) -> tuple[FloatArray, FloatArray]:
        """Estimates of the models, (B, M, n), and their covariances, (B, M, n, n)."""
        return self._estimates_with(self.order, None)

    def _estimates_with(
        self,
        order: int,
        variances: FloatArray | None,
    ) -> tuple[FloatArray, FloatArray]:
        """Return the estimates of the models with the same number of values per axis, see
        `resized`.
        """
        parts = [
            resized(one.state, one.covariance, self.axes, order, variances) for one in self.filters
        ]
        state, covariance = (np.stack(values, axis=1) for values in zip(*parts, strict=True))
        return state, covariance

    def begin_from_models(
        self,
        probabilities: ArrayLike,
        states: ArrayLike,
        covariances: ArrayLike,
    ) -> None:
        """Forget everything and begin all tracks with probabilities (B, M) and `estimates` of
        the models.

        Derivatives that a model lacks are not used.
        """
        count = len(self.filters)
        size = self.axes * self.order
        weights = check_array("probabilities", probabilities, (None, count))
        if (weights < 0.0).any() or not np.allclose(weights.sum(-1), 1.0):
            raise reject(
                "probabilities",
                probabilities,
                "numbers >= 0 whose sum is 1 for each track",
            )
        means = check_array("states", states, (len(weights), count, size))
        matrices = check_array("covariances", covariances, (len(weights), count, size, size))
        matrices = check_covariance("covariances", matrices, definite=False)
        self._begin(len(weights))
        self._log_probabilities = np.log(np.maximum(weights, SMALLEST))
        for j, one in enumerate(self.filters):
            one._set(*resized(means[:, j], matrices[:, j], self.axes, one.order, None))
        self._merge()

    def transition(self, dt: float | FloatArray) -> FloatArray:
        """Transition matrix of the models, (M, M) or (B, M, M), in a time step [s]."""
        return self._chain.transition(dt)

    def _begin(self, tracks: int) -> None:
        for one in self.filters:
            one._begin(tracks)
        self._log_probabilities = np.log(
            np.broadcast_to(self._stationary, (tracks, len(self.filters)))
        ).copy()
        self._merge()
        self._no_measurement()

    def _set(self, state: FloatArray, covariance: FloatArray | None) -> None:
        assert covariance is not None
        for one in self.filters:
            one._set(*resized(state, covariance, self.axes, one.order, None))
        self._merge()

    def _predict(self, dt: float | FloatArray) -> None:
        after, weights = mix_models(self._log_probabilities, self.transition(dt), SMALLEST)
        mixed = [
            mixture(*self._estimates_with(one.order, one.start_variances), weights[:, j, None])
            for j, one in enumerate(self.filters)
        ]
        for one, (state, covariance) in zip(self.filters, mixed, strict=True):
            one._set(state[:, 0], covariance[:, 0])
            one._predict(dt)
        self._log_probabilities = after
        self._merge()

    def _update(self, measurement: FloatArray, noise: FloatArray | None) -> None:
        noises = [one.noise if noise is None else noise for one in self.filters]
        of_models = sum(
            p[:, None, None] * one for p, one in zip(self.probabilities.T, noises, strict=True)
        )
        spread = self.covariance[:, :: self.order, :: self.order] + of_models
        self.nis = squared_innovation(measurement - self.position, spread)
        for one in self.filters:
            one._update(measurement, noise)
        each = np.stack([one.log_likelihood for one in self.filters], axis=-1)
        self._log_probabilities, self.log_likelihood = weigh_models(
            self._log_probabilities,
            each,
            SMALLEST,
        )
        self._merge()

    def _merge(self) -> None:
        """Compute mean and covariance of the mixture of all models."""
        state, covariance = mixture(*self.estimates, self.probabilities[:, None])
        self.state, self.covariance = state[:, 0], covariance[:, 0]
