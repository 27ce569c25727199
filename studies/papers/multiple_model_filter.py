"""Multiple model estimators of straight motion and turns of known radii: static, GPB1, IMM and
GPB2.

Each mode has a Kalman filter of [x, vx, y, vy], whose turn rate follows from its estimated speed.
Where the mode may change, it starts (Bar-Shalom, Li & Kirubarajan 2001, section 11.6) with "static"
from its own estimate; with "gpb1", generalized pseudo-Bayesian of first order, from the estimate
merged over all modes; with "imm" from the mixture of all estimates before, given its mode; with
"gpb2" from each estimate before, in M^2 filters, merged over it afterwards.
"""

from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import logsumexp

FloatArray = NDArray[np.float64]
Method = Literal["static", "gpb1", "imm", "gpb2"]
# Smaller probabilities count as this one.
SMALLEST = np.log(1e-300)


def turn_transition(rates: FloatArray, dt: float) -> FloatArray:
    """Return the matrices (..., 4, 4) of turns with rates (...) [rad/s], anticlockwise positive,
    0 straight, in a step [s].
    """
    sine, cosine = np.sin(rates * dt), np.cos(rates * dt)
    safe = np.where(rates == 0.0, 1.0, rates)
    along = np.where(
        rates == 0.0,
        dt,
        sine / safe,
    )
    across = np.where(
        rates == 0.0,
        0.0,
        (1.0 - cosine) / safe,
    )
    zero, unit = np.zeros_like(rates), np.ones_like(rates)
    rows = [
        [unit, along, zero, -across],
        [zero, cosine, zero, -sine],
        [zero, across, unit, along],
        [zero, sine, zero, cosine],
    ]
    return np.moveaxis(
        np.array(rows),
        (0, 1),
        (-2, -1),
    )


def mixture(
    weights: FloatArray,
    state: FloatArray,
    covariance: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return mean and covariance, (..., C, 4) and (..., C, 4, 4), of C mixtures with weights
    (..., C, K) of the same K normal distributions, (..., K, 4) and (..., K, 4, 4).
    """
    mean = weights @ state
    # Sum of w (P + x x') less m m', with states relative to one of them, because positions are
    # large.
    relative = state - state[..., :1, :]
    centre = mean - state[..., :1, :]
    square = covariance + relative[..., :, None] * relative[..., None, :]
    mixed = weights @ square.reshape(*square.shape[:-2], 16)
    square = mixed.reshape(*mean.shape, 4)
    return mean, square - centre[..., :, None] * centre[..., None, :]


class MultipleModels:
    """One of the four estimators for n tracks, all modes equally probable at the start.

    Args:
        method: the estimator.
        radii: turn radii [m]; mode 0 is straight, then all left turns, then all right turns.
        process_variance: Q, variance of the noise added to each velocity in a step [m^2/s^2].
        noise: variance of a measurement [m^2], or (2,) of x and y.
        state: (n, 4) estimates at the start [m, m/s].
        covariance: (4, 4) of them.
    """

    def __init__(
        self,
        method: Method,
        radii: Sequence[float],
        process_variance: float,
        noise: ArrayLike,
        state: FloatArray,
        covariance: FloatArray,
    ):
        self.method = method
        curvatures = 1.0 / np.array(radii)
        self.curvatures = np.concatenate([[0.0], curvatures, -curvatures])
        self.process = np.diag([0.0, process_variance] * 2)
        self.noise = np.broadcast_to(noise, 2)
        n, modes = len(state), self.curvatures.size
        # Filters of (n, mode, mode before); the last axis has length 1 if that does not matter.
        self.states = np.tile(state[:, None, None], (1, modes, 1, 1))
        self.covariances = np.tile(covariance, (n, modes, 1, 1, 1))
        self.log_probability = np.full((n, modes, 1), -np.log(modes))

    @property
    def filters(self) -> int:
        """Number of Kalman filters of a track."""
        return self.log_probability[0].size

    @property
    def probabilities(self) -> FloatArray:
        """(n, M) of the modes."""
        return np.exp(logsumexp(self.log_probability, axis=2))

    def merged(self) -> tuple[FloatArray, FloatArray]:
        """Return the estimates, (n, 4), and their covariances, (n, 4, 4)."""
        n = len(self.states)
        weights = np.exp(self.log_probability).reshape(
            n,
            1,
            -1,
        )
        states, covariances = (
            self.states.reshape(n, -1, 4),
            self.covariances.reshape(n, -1, 4, 4),
        )
        state, covariance = mixture(weights, states, covariances)
        return state[:, 0], covariance[:, 0]

    def step(
        self,
        measured: FloatArray,
        dt: float,
        transition: FloatArray | None,
    ) -> None:
        """Advance by a time step [s] to measurements (n, 2) [m]. `transition` has the
        probabilities of the modes given the mode before (row), (M, M); None: the mode stays.
        """
        prior = logsumexp(self.log_probability, axis=2)
        if self.method == "gpb1":
            state, covariance = (part[:, None] for part in self.merged())
        else:
            # Merge the filters of each mode over the mode before.
            weights = np.exp(self.log_probability - prior[..., None])[:, :, None]
            state, covariance = (
                part[:, :, 0] for part in mixture(weights, self.states, self.covariances)
            )
        state, covariance = state[:, :, None], covariance[:, :, None]
        self.log_probability = prior[..., None]
        if transition is not None and self.method != "static":
            with np.errstate(divide="ignore"):
                # After, before.
                joint = (np.log(transition) + prior[:, :, None]).swapaxes(1, 2)
            after = logsumexp(joint, axis=2)
            weights = np.exp(joint - after[..., None])
            self.log_probability = np.maximum(after, SMALLEST)[..., None]
            if self.method == "imm":
                mixed = mixture(
                    weights,
                    state[:, :, 0],
                    covariance[:, :, 0],
                )
                state, covariance = mixed[0][:, :, None], mixed[1][:, :, None]
            elif self.method == "gpb2":
                shares = np.log(np.maximum(weights, np.exp(SMALLEST)))
                self.log_probability = self.log_probability + shares
                state, covariance = state.swapaxes(1, 2), covariance.swapaxes(1, 2)
        rates = self.curvatures[:, None] * np.hypot(state[..., 1], state[..., 3])
        matrix = turn_transition(rates, dt)
        state = (matrix @ state[..., None])[..., 0]
        covariance = matrix @ covariance @ matrix.swapaxes(-1, -2) + self.process
        log_likelihood = np.zeros(state.shape[:-1])
        for axis, variance in enumerate(self.noise):
            column = covariance[..., 2 * axis]
            spread = column[..., 2 * axis] + variance
            innovation = measured[:, None, None, axis] - state[..., 2 * axis]
            gain = column / spread[..., None]
            state = state + gain * innovation[..., None]
            covariance = covariance - gain[..., :, None] * column[..., None, :]
            log_likelihood -= 0.5 * (innovation**2 / spread + np.log(2.0 * np.pi * spread))
        self.states, self.covariances = state, covariance
        posterior = self.log_probability + log_likelihood
        total = logsumexp(posterior, axis=(1, 2), keepdims=True)
        self.log_probability = np.maximum(posterior - total, SMALLEST)
