"""The interacting multiple model filter over turn rates, see `imm` and `turns`, with real time steps."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baselines.estimation.batch import Batch
from baselines.estimation.imm import ModelChain, mix_models, weigh_models
from baselines.estimation.mixture import log_sum, mixture
from baselines.estimation.turns import TurnModel, start_turns, step_turns

FloatArray = NDArray[np.float64]

SMALLEST = 1e-12  # probability of a model


class TurnEstimates(NamedTuple):
    """Output for T positions of B pieces.

    Attributes:
        probabilities: (T, B, 3) of straight motion, left and right turns.
        log_likelihoods: (T, B, 3) of each position given its mode and all positions before.
        rates: (T, B) mean turn rate [rad/s].
        speeds: (T, B) speed [m/s].
        innovations: (T, B, 2) along and across the predicted velocity, in standard deviations.
    """

    probabilities: FloatArray
    log_likelihoods: FloatArray
    rates: FloatArray
    speeds: FloatArray
    innovations: FloatArray


def run_turn_imm(batch: Batch, model: TurnModel | None = None) -> TurnEstimates:
    """Run the filter over pieces of flights; rows after the end of a piece repeat its last values."""
    settings = TurnModel() if model is None else model
    omega, chain = np.radians(settings.rates), ModelChain(settings.generator)
    groups = (settings.modes == np.arange(3)[:, None]).astype(np.float64)  # (3, M)
    (total, tracks), steps, present = batch.times.shape, batch.steps, batch.present[..., None]
    state, covariance = start_turns(batch, len(omega))
    log_probability = np.tile(np.log(settings.start), (tracks, 1))
    output = TurnEstimates(
        np.empty((total, tracks, 3)), np.zeros((total, tracks, 3)), np.zeros((total, tracks)),
        np.empty((total, tracks)), np.zeros((total, tracks, 2)),
    )  # fmt: skip
    for k in range(total):
        if k:
            log_probability, weights = mix_models(log_probability, chain.transition(steps[k]), SMALLEST)
            probability = np.exp(log_probability)
            state, covariance = mixture(state, covariance, weights)
            now = step_turns(
                batch, batch.positions[k], steps[k], state, covariance, omega, probability, settings
            )
            state, covariance = now.state, now.covariance
            prior = np.log(np.maximum(probability @ groups.T, SMALLEST))
            joint = (log_probability + now.log_likelihood)[:, None] + np.where(groups > 0.0, 0.0, -np.inf)
            output.log_likelihoods[k] = np.where(present[k], log_sum(joint, 2) - prior, 0.0)
            output.innovations[k] = np.where(
                present[k], _turned(now.mean, now.spread, batch.positions[k]), 0.0
            )
            log_probability, _ = weigh_models(log_probability, now.log_likelihood, SMALLEST)
        probability = np.exp(log_probability)
        mean = (probability[..., None] * state).sum(1)
        output.probabilities[k] = probability @ groups.T
        output.rates[k] = probability @ omega
        output.speeds[k] = np.hypot(mean[:, 1], mean[:, 3])
    return output


def _turned(mean: FloatArray, spread: FloatArray, z: FloatArray) -> FloatArray:
    """Return the innovation of the mean along and across the velocity, (B, 2), in standard deviations."""
    velocity = mean[:, 1::2]
    along = velocity / np.maximum(np.hypot(velocity[:, 0], velocity[:, 1]), 1e-9)[:, None]
    frame = np.stack([along, np.stack([-along[:, 1], along[:, 0]], -1)], -2)
    variances = np.einsum("bij,bjk,bik->bi", frame, spread, frame)
    return np.asarray((frame @ (z - mean[:, ::2])[..., None])[..., 0] / np.sqrt(variances))
