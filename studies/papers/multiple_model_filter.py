"""Multiple model estimators of straight motion and turns of known radii: static, GPB1, IMM and
GPB2.

Each mode has a Kalman filter of [x, vx, y, vy], whose turn rate follows from its estimated speed.
Where the mode may change, it starts (Bar-Shalom, Li & Kirubarajan 2001, section 11.6) with "static"
from its own estimate; with "gpb1", generalized pseudo-Bayesian of first order, from the estimate
merged over all modes; with "imm" from the mixture of all estimates before, given its mode; with
"gpb2" from each estimate before, in M^2 filters, merged over it afterwards.
"""

import math
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from baselines.estimation import imm
from baselines.estimation.correction import correct, principal_noise
from baselines.estimation.kalman import propagate
from baselines.estimation.motion_models import turn_transition
from baselines.estimation.track_filter import TrackFilter, measurement_covariance
from hybrid_env.checks import FloatArray, check_choice, check_positive, reject
from hybrid_env.limits import distinct_radii

Method = Literal["static", "gpb1", "imm", "gpb2"]


class MultipleModelFilter(TrackFilter):
    """One of the four estimators. Tracks begin with `begin_from`, all modes equally probable.

    Args:
        method: the estimator.
        radii: (n,) turn radii [m]; mode 0 is straight, 1 .. n are left turns, n + 1 .. 2n right
            turns.
        process_variance: Q, variance of the noise added to each velocity in a step [m^2/s^2].
        noise: covariance of a measurement [m^2], see `track_filter.measurement_covariance`.
    """

    axes = 2
    order = 2
    covariance: FloatArray
    # Number of Kalman filters that ran in the last step.
    filters: int
    # (M, M) probabilities of the modes in a step given the mode before (row), to be set before any
    # step; None: the mode does not change.
    transition: FloatArray | None = None

    def __init__(
        self,
        method: Method,
        radii: ArrayLike,
        process_variance: float,
        noise: float | ArrayLike,
    ):
        self.method = check_choice("method", method, get_args(Method))
        curvatures = 1.0 / np.array(distinct_radii("radii", radii))
        self._curvatures = np.concatenate([[0.0], curvatures, -curvatures])[:, None]
        process_variance = check_positive("process_variance", process_variance, allow_zero=True)
        self._process = np.diag([0.0, process_variance] * 2)
        self.noise = measurement_covariance("noise", noise, self.axes)

    @property
    def probabilities(self) -> FloatArray:
        """(B, M) of the modes."""
        return np.exp(imm.log_sum(self._log_probability, 2))

    def _begin(self, tracks: int) -> None:
        self._set(np.full((tracks, 4), np.nan), np.full((tracks, 4, 4), np.nan))

    def _set(self, state: FloatArray, covariance: FloatArray | None) -> None:
        assert covariance is not None
        self.state, self.covariance, self.filters = state, covariance, self._curvatures.size
        # Filters of (B, mode, mode before); the last axis has length 1 if the mode before does not
        # matter.
        self._states, self._covariances = (
            np.repeat(one[:, None, None], self.filters, axis=1) for one in (state, covariance)
        )
        self._log_probability = np.full((len(state), self.filters, 1), -math.log(self.filters))
        self._no_measurement()

    def _predict(self, dt: float | FloatArray) -> None:
        prior = imm.log_sum(self._log_probability, 2)
        if self.method == "gpb1":
            state, covariance = self.state[:, None], self.covariance[:, None]
        else:
            # Merge the filters of each mode over the mode before.
            weights = np.exp(self._log_probability - prior[..., None])
            state, covariance = (
                one.reshape(*prior.shape, *one.shape[2:])
                for one in self._mixture(weights, prior.size)
            )
        if self.transition is not None and self.method != "static":
            prior, weights = imm.mix_models(prior, self.transition, imm.SMALLEST)
            if self.method == "imm":
                state, covariance = imm.mixture(state, covariance, weights)
        if self.transition is not None and self.method == "gpb2":
            prior = prior[..., None] + np.log(np.maximum(weights, imm.SMALLEST))
            state, covariance = state[:, None], covariance[:, None]
        else:
            prior, state, covariance = prior[..., None], state[:, :, None], covariance[:, :, None]
        rates = self._curvatures * np.hypot(state[..., 1], state[..., 3])
        self._states, self._covariances = propagate(
            np.broadcast_to(state, (*prior.shape, 4)),
            np.broadcast_to(covariance, (*prior.shape, 4, 4)),
            turn_transition(rates, np.asarray(dt)[..., None, None]),
            self._process,
            np.ones(1),
        )
        self._log_probability = prior
        self.filters = prior[0].size
        self._merge()

    def _update(self, measurement: FloatArray, noise: FloatArray | None) -> None:
        if np.isnan(self.state).any():
            raise reject("state", None, "a start of all tracks by begin_from()")
        noise = self.noise if noise is None else noise
        self.nis = imm.squared_innovation(
            measurement - self.position,
            self.covariance[:, ::2, ::2] + noise,
        )
        used = ~np.isnan(self.nis)[:, None, None]
        measured = np.where(used[..., None], measurement[:, None, None], 0.0)
        of_filters = principal_noise(noise if noise.ndim == 2 else noise[:, None, None])
        after = correct(self._states, self._covariances, measured, of_filters)
        self._states = np.where(used[..., None], after.state, self._states)
        self._covariances = np.where(used[..., None, None], after.covariance, self._covariances)
        flat = self.tracks, self.filters
        likelihood = np.where(used, after.log_likelihood, 0.0).reshape(flat)
        prior, shape = self._log_probability.reshape(flat), self._log_probability.shape
        posterior, self.log_likelihood = imm.weigh_models(prior, likelihood, imm.SMALLEST)
        self._log_probability = posterior.reshape(shape)
        self._merge()

    def _merge(self) -> None:
        merged = self._mixture(np.exp(self._log_probability), self.tracks)
        self.state, self.covariance = (one[:, 0] for one in merged)

    def _mixture(self, weights: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
        """Return `count` mixtures of equally many filters one after the other."""
        state = self._states.reshape(count, -1, 4)
        covariance = self._covariances.reshape(count, -1, 4, 4)
        return imm.mixture(state, covariance, weights.reshape(count, 1, -1))
