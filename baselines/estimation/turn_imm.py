"""The interacting multiple model filter over turn rates, with the noise of the flights and real time steps.

Blom & Bar-Shalom 1988, with the coordinated turns of Bar-Shalom, Li & Kirubarajan 2001, section 11.7: each
model moves at a known turn rate and is driven by white acceleration.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baselines.estimation.turn_filters import correct, mixtures, predict_turns, start_filters
from baselines.recordings.flights.batch import Batch, measurement_covariances
from baselines.recordings.flights.labels import LEFT, RIGHT, STRAIGHT

FloatArray = NDArray[np.float64]

SMALLEST = 1e-12  # probability of a model


@dataclass(frozen=True, kw_only=True)
class TurnModel:
    """Settings of the filter; chosen for the largest agreement on simulated flights.

    Attributes:
        rates: turn rates [deg/s], straight motion first, anticlockwise positive.
        acceleration: spectral density of the white acceleration [m^2/s^3].
        straight, turn: mean time in straight motion and in a turn [s].
        within: mean time between two turn rates of one direction [s].
        freedom: degrees of freedom nu of the Student t.
    """

    rates: tuple[float, ...] = (0.0, 0.75, 1.5, 3.0, -0.75, -1.5, -3.0)
    acceleration: float = 0.2
    straight: float = 60.0
    turn: float = 40.0
    within: float = 15.0
    freedom: float = 5.0

    @property
    def modes(self) -> NDArray[np.int64]:
        """(M,) straight, left or right, of each model."""
        rates = np.array(self.rates)
        return np.where(rates > 0.0, LEFT, np.where(rates < 0.0, RIGHT, STRAIGHT))

    @property
    def start(self) -> FloatArray:
        """(M,) probabilities of the models at the start of a piece: straight motion is likely."""
        others = len(self.rates) - 1
        return np.array([0.9, *[0.1 / others] * others]) if others else np.ones(1)

    @property
    def generator(self) -> FloatArray:
        """(M, M) rates of change between the models [1/s]; rows sum to 0."""
        modes = self.modes
        matrix = np.zeros((len(modes), len(modes)))
        for i, one in enumerate(modes):
            for j, other in enumerate(modes):
                if i == j:
                    continue
                if one == STRAIGHT:
                    matrix[i, j] = 1.0 / self.straight / (modes != STRAIGHT).sum()
                elif other == one:
                    matrix[i, j] = 1.0 / self.within / max((modes == one).sum() - 1, 1)
                else:  # most turns end in straight motion
                    share = 0.9 if other == STRAIGHT else 0.1 / (modes == other).sum()
                    matrix[i, j] = share / self.turn
        return np.asarray(matrix - np.diag(matrix.sum(1)))


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
    omega, modes = np.radians(settings.rates), settings.modes
    total, tracks = batch.times.shape
    count = len(omega)
    groups = (modes == np.arange(3)[:, None]).astype(np.float64)  # (3, M)
    values, vectors = np.linalg.eig(settings.generator)
    inverse = np.linalg.inv(vectors)
    state, covariance = start_filters(batch, count)
    probability = np.tile(settings.start, (tracks, 1))
    output = TurnEstimates(
        np.empty((total, tracks, 3)), np.zeros((total, tracks, 3)), np.zeros((total, tracks)),
        np.empty((total, tracks)), np.zeros((total, tracks, 2)),
    )  # fmt: skip
    present, steps = batch.present, batch.steps
    for k in range(total):
        if k:
            chain = np.real((vectors * np.exp(values * steps[k][:, None])[:, None, :]) @ inverse)
            state, covariance, probability = _mixed(state, covariance, probability, chain)
            state, covariance = predict_turns(state, covariance, omega, settings.acceleration, steps[k])
            mean = (probability[..., None] * state).sum(1)
            noise = measurement_covariances(mean[:, 2:], batch.across, batch.timing)
            used = present[k]
            z = np.where(used[:, None], batch.positions[k], 0.0)
            new = correct(state, covariance, z, noise, settings.freedom)
            log_likelihood = new[2] + np.log(probability)
            after = np.exp(log_likelihood - log_likelihood.max(1, keepdims=True))
            after = np.maximum(after / after.sum(1, keepdims=True), SMALLEST)
            after /= after.sum(1, keepdims=True)
            prior = np.maximum(probability @ groups.T, SMALLEST)
            peak = new[2].max(1, keepdims=True)
            of_mode = (
                np.log(np.maximum((probability * np.exp(new[2] - peak)) @ groups.T, 1e-300) / prior) + peak
            )
            output.log_likelihoods[k] = np.where(used[:, None], of_mode, 0.0)
            output.innovations[k] = np.where(
                used[:, None], _turned(mean, covariance, probability, noise, z), 0.0
            )
            state = np.where(used[:, None, None], new[0], state)
            covariance = np.where(used[:, None, None, None], new[1], covariance)
            probability = np.where(used[:, None], after, probability)
        mean = (probability[..., None] * state).sum(1)
        output.probabilities[k] = probability @ groups.T
        output.rates[k] = probability @ omega
        output.speeds[k] = np.hypot(mean[:, 2], mean[:, 3])
    return output


def _mixed(
    state: FloatArray, covariance: FloatArray, probability: FloatArray, chain: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Mix the models for one step of the chain, (B, M, M)."""
    joint = probability[:, :, None] * np.maximum(chain, 0.0)  # before, after
    after = np.maximum(joint.sum(1), SMALLEST)
    weights = (joint / after[:, None, :]).swapaxes(1, 2)  # after, before
    return *mixtures(state, covariance, weights), after / after.sum(1, keepdims=True)


def _turned(
    mean: FloatArray, covariance: FloatArray, probability: FloatArray, noise: FloatArray, z: FloatArray
) -> FloatArray:
    """Return the innovation of the mean along and across the velocity, (B, 2), in standard deviations."""
    speed = np.maximum(np.hypot(mean[:, 2], mean[:, 3]), 1e-9)
    along = mean[:, 2:] / speed[:, None]
    frame = np.stack([along, np.stack([-along[:, 1], along[:, 0]], -1)], -2)
    spread = (probability[..., None, None] * covariance[..., :2, :2]).sum(1) + noise
    variances = np.einsum("bij,bjk,bik->bi", frame, spread, frame)
    moved = (frame @ (z - mean[:, :2])[..., None])[..., 0]
    return np.asarray(moved / np.sqrt(variances))
