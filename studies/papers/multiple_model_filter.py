"""Multiple model estimators of straight motion and turns of known radii: static, GPB1, IMM and
GPB2.

Each mode has a Kalman filter of [x, vx, y, vy], whose turn rate follows from its estimated speed.
Where the mode may change, it starts (Bar-Shalom, Li & Kirubarajan 2001, section 11.6) with "static"
from its own estimate; with "gpb1", generalized pseudo-Bayesian of first order, from the estimate
merged over all modes; with "imm" from the mixture of all estimates before, given its mode; with
"gpb2" from each estimate before, in M^2 filters, merged over it afterwards.
"""

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import logsumexp

from baselines import mixture
from studies.flights.turns import turn_transition
from studies.papers.published import FloatArray

# Smaller probabilities count as this one.
SMALLEST = np.log(1e-300)


class MultipleModels:
    """One of the four estimators for n tracks, all modes equally probable at the start.

    Args:
        method: the estimator.
        radii: (M,) turn radii [m], positive to the left, negative to the right, 0 if straight.
        process_variance: Q, variance of the noise added to each velocity in a step [m^2/s^2].
        noise: variance of a measurement [m^2], or (2,) of x and y.
        state: (n, 4) estimates at the start [m, m/s].
        covariance: (4, 4) of them.
    """

    def __init__(
        self,
        method: Literal["static", "gpb1", "imm", "gpb2"],
        radii: FloatArray,
        process_variance: float,
        noise: ArrayLike,
        state: FloatArray,
        covariance: FloatArray,
    ):
        self.method = method
        self.curvatures = np.divide(1.0, radii, out=np.zeros(len(radii)), where=radii != 0.0)
        self.process = np.diag([0.0, process_variance] * 2)
        self.noise = np.broadcast_to(noise, 2)
        n, modes = len(state), len(radii)
        # By track and mode.
        self.states = np.repeat(state[:, None], modes, axis=1)
        self.covariances = np.tile(covariance, (n, modes, 1, 1))
        self.log_probability = np.full((n, modes), -np.log(modes))
        # Kalman filters of a track in the last step.
        self.filters = modes

    @property
    def probabilities(self) -> FloatArray:
        """(n, M) of the modes."""
        return np.exp(self.log_probability)

    def merged(self) -> tuple[FloatArray, FloatArray]:
        """Return the estimates, (n, 1, 4), and their covariances, (n, 1, 4, 4)."""
        return mixture(self.states, self.covariances, self.probabilities[:, None])

    def step(self, measured: FloatArray, dt: float, transition: FloatArray | None) -> None:
        """Advance by a time step [s] to measurements (n, 2) [m]. `transition` has the
        probabilities of the modes given the mode before (row), (M, M); None: the mode stays.
        """
        state, covariance = (
            self.merged() if self.method == "gpb1" else (self.states, self.covariances)
        )
        # (n, mode, mode before); the last axis has length 1 if that does not matter.
        joint = self.log_probability[:, :, None]
        before = 2
        if transition is not None and self.method != "static":
            with np.errstate(divide="ignore"):
                joint = (np.log(transition) + joint).swapaxes(1, 2)
            if self.method == "gpb2":
                before = 1
            else:
                after = logsumexp(joint, axis=2, keepdims=True)
                if self.method == "imm":
                    state, covariance = mixture(state, covariance, np.exp(joint - after))
                joint = after
        joint = np.maximum(joint, SMALLEST)
        self.filters = joint[0].size
        state, covariance = (np.expand_dims(part, before) for part in (state, covariance))
        rates = self.curvatures[:, None] * np.hypot(state[..., 1], state[..., 3])
        matrix = turn_transition(rates, np.asarray(dt))
        state = (matrix @ state[..., None])[..., 0]
        covariance = matrix @ covariance @ matrix.swapaxes(-1, -2) + self.process
        for axis, variance in enumerate(self.noise):
            column = covariance[..., 2 * axis]
            spread = column[..., 2 * axis] + variance
            innovation = measured[:, None, None, axis] - state[..., 2 * axis]
            gain = column / spread[..., None]
            state = state + gain * innovation[..., None]
            covariance = covariance - gain[..., :, None] * column[..., None, :]
            joint = joint - 0.5 * (innovation**2 / spread + np.log(2.0 * np.pi * spread))
        # Merge the filters of each mode over the mode before.
        posterior = logsumexp(joint, axis=2, keepdims=True)
        shape = self.states.shape
        states, covariances = mixture(
            state.reshape(-1, *state.shape[2:]),
            covariance.reshape(-1, *covariance.shape[2:]),
            np.exp(joint - posterior).reshape(-1, 1, joint.shape[2]),
        )
        self.states, self.covariances = states.reshape(shape), covariances.reshape(*shape, 4)
        posterior = posterior[..., 0]
        posterior = posterior - logsumexp(posterior, axis=1, keepdims=True)
        self.log_probability = np.maximum(posterior, SMALLEST)
