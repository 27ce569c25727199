"""The interacting multiple model filter over turn rates, with the noise of the flights and real time steps.

Blom & Bar-Shalom 1988, with the coordinated turns of Bar-Shalom, Li & Kirubarajan 2001, section 11.7: each
model moves at a known turn rate and is driven by white acceleration. The covariance of a measurement is
across^2 I + timing^2 v v' with the predicted velocity v, and its distribution a Student t: the model weights
a far measurement less, by (nu + 2) / (nu + NIS).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baselines.flights.batch import Batch, measurement_covariances
from baselines.flights.labels import LEFT, RIGHT, STRAIGHT

FloatArray = NDArray[np.float64]

SMALLEST = 1e-12  # probability of a model
START_SPEED = 100.0  # standard deviation of each component of the velocity at the start [m/s]


@dataclass(frozen=True, kw_only=True)
class TurnModel:
    """Settings of the filter; chosen for the largest agreement on simulated flights.

    Attributes:
        rates: turn rates [deg/s], straight motion first, anticlockwise positive.
        acceleration: spectral density of the white acceleration in straight motion and in turns [m^2/s^3].
        straight, turn: mean time in straight motion and in a turn [s].
        within: mean time between two turn rates of one direction [s].
        freedom: degrees of freedom nu of the Student t.
    """

    rates: tuple[float, ...] = (0.0, 1.5, 3.0, -1.5, -3.0)
    acceleration: tuple[float, float] = (0.1, 2.0)
    straight: float = 150.0
    turn: float = 40.0
    within: float = 20.0
    freedom: float = 4.0

    @property
    def modes(self) -> NDArray[np.int64]:
        """(M,) straight, left or right, of each model."""
        rates = np.array(self.rates)
        return np.where(rates > 0.0, LEFT, np.where(rates < 0.0, RIGHT, STRAIGHT))

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
    density = np.where(modes == STRAIGHT, *settings.acceleration)[:, None]
    state, covariance = _start(batch, count)
    probability = np.full((tracks, count), 0.1 / max(count - 1, 1))
    probability[:, 0] = 0.9 if count > 1 else 1.0
    output = TurnEstimates(
        np.empty((total, tracks, 3)), np.zeros((total, tracks, 3)), np.zeros((total, tracks)),
        np.empty((total, tracks)), np.zeros((total, tracks, 2)),
    )  # fmt: skip
    present, steps = batch.present, batch.steps
    for k in range(total):
        if k:
            chain = np.real((vectors * np.exp(values * steps[k][:, None])[:, None, :]) @ inverse)
            state, covariance, probability = _mixed(state, covariance, probability, chain)
            state, covariance = _predicted(state, covariance, omega, density, steps[k])
            mean = (probability[..., None] * state).sum(1)
            noise = measurement_covariances(mean[:, 2:], batch.across, batch.timing)
            used = present[k]
            z = np.where(used[:, None], batch.positions[k], 0.0)
            new = _updated(state, covariance, z, noise, settings.freedom)
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


def _start(batch: Batch, count: int) -> tuple[FloatArray, FloatArray]:
    """Return states [x, y, vx, vy], (B, M, 4), and covariances at the first positions."""
    tracks = batch.times.shape[1]
    velocity = batch.positions[1] - batch.positions[0]
    velocity = velocity / (batch.times[1] - batch.times[0])[:, None]
    state = np.repeat(np.concatenate([batch.positions[0], velocity], axis=1)[:, None], count, axis=1)
    covariance = np.zeros((tracks, count, 4, 4))
    noise = measurement_covariances(velocity, batch.across, batch.timing)
    covariance[:, :, :2, :2] = noise[:, None]
    covariance[:, :, 2, 2] = covariance[:, :, 3, 3] = START_SPEED**2
    return state, covariance


def _mixed(
    state: FloatArray, covariance: FloatArray, probability: FloatArray, chain: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Mix the models for one step of the chain, (B, M, M)."""
    joint = probability[:, :, None] * np.maximum(chain, 0.0)  # before, after
    after = np.maximum(joint.sum(1), SMALLEST)
    weights = (joint / after[:, None, :]).swapaxes(1, 2)  # after, before
    mean = weights @ state
    # sum of w (P + x x') less m m', with states relative to one of them, because positions are large
    relative = state - state[:, :1]
    centre = mean - state[:, :1]
    square = covariance + relative[..., :, None] * relative[..., None, :]
    tracks, count = probability.shape
    mixed = (weights @ square.reshape(tracks, count, 16)).reshape(tracks, count, 4, 4)
    return mean, mixed - centre[..., :, None] * centre[..., None, :], after / after.sum(1, keepdims=True)


def _predicted(
    state: FloatArray, covariance: FloatArray, omega: FloatArray, density: FloatArray, steps: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Predict coordinated turns with steps (B,) [s]; density is (M, 1)."""
    angle = omega * steps[:, None]
    safe = np.where(omega == 0.0, 1.0, omega)
    sine, cosine = np.sin(angle), np.cos(angle)
    along = np.where(omega == 0.0, steps[:, None], sine / safe)
    aside = np.where(omega == 0.0, 0.0, (1.0 - cosine) / safe)
    matrix = np.zeros((*angle.shape, 4, 4))
    matrix[..., 0, 0] = matrix[..., 1, 1] = 1.0
    matrix[..., 0, 2] = matrix[..., 1, 3] = along
    matrix[..., 1, 2], matrix[..., 0, 3] = aside, -aside
    matrix[..., 2, 2] = matrix[..., 3, 3] = cosine
    matrix[..., 3, 2], matrix[..., 2, 3] = sine, -sine
    covariance = matrix @ covariance @ matrix.swapaxes(-1, -2)
    dt = steps[:, None]
    for axis in (0, 1):
        covariance[..., axis, axis] += density.T * dt**3 / 3.0
        covariance[..., axis, axis + 2] += density.T * dt**2 / 2.0
        covariance[..., axis + 2, axis] += density.T * dt**2 / 2.0
        covariance[..., axis + 2, axis + 2] += density.T * dt
    return (matrix @ state[..., None])[..., 0], 0.5 * (covariance + covariance.swapaxes(-1, -2))


def _inverse(matrix: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return inverses and determinants of matrices (..., 2, 2)."""
    a, b, c, d = matrix[..., 0, 0], matrix[..., 0, 1], matrix[..., 1, 0], matrix[..., 1, 1]
    determinant = a * d - b * c
    adjugate = np.stack([np.stack([d, -b], -1), np.stack([-c, a], -1)], -2)
    return adjugate / determinant[..., None, None], determinant


def _updated(
    state: FloatArray, covariance: FloatArray, z: FloatArray, noise: FloatArray, freedom: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return corrected states and covariances, and the log-likelihoods (B, M)."""
    innovation = z[:, None] - state[..., :2]
    inverse, determinant = _inverse(covariance[..., :2, :2] + noise[:, None])
    nis = (innovation[..., None, :] @ inverse @ innovation[..., :, None])[..., 0, 0]
    likelihood = -0.5 * np.log(determinant) - 0.5 * (freedom + 2.0) * np.log1p(nis / freedom)
    weight = np.minimum((freedom + 2.0) / (freedom + nis), 1.0)
    inverse, _ = _inverse(covariance[..., :2, :2] + noise[:, None] / weight[..., None, None])
    gain = covariance[..., :, :2] @ inverse
    state = state + (gain @ innovation[..., None])[..., 0]
    return state, covariance - gain @ covariance[..., :2, :], likelihood


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
