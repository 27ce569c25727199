"""Filters of coordinated turns with known turn rates, and the interacting multiple model of them.
The states are [x, vx, y, vy]; with wind [x, vx, wx, y, vy, wy]: the velocity v in the air turns,
and the wind w, a random walk, carries the object along. The covariance of a measurement is across^2
I + timing^2 v v' with the predicted velocity v, and its distribution a Student t. Pieces of several
flights are columns of arrays.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from baselines.estimation.correction import WholeStudentT, correct, principal_noise
from baselines.estimation.imm import ModelChain, log_sum, mix_models, mixture, weigh_models
from baselines.estimation.kalman import propagate
from baselines.estimation.motion_models import turn_noise, turn_transition
from hybrid_env.checks import BoolArray, FloatArray, IntArray

STRAIGHT, LEFT, RIGHT = 0, 1, 2
# Standard deviation of each component of the velocity at the start [m/s].
START_SPEED = 100.0
# Of the wind, if it is in the state [m/s].
START_WIND = 5.0
# Climb rates further from `TurnModel.climb_level` count as at this distance [m/s].
CLIMB_RANGE = 3.0
# Probability of a model.
SMALLEST = 1e-12


class Batch(NamedTuple):
    """B pieces of flights of at most T positions, padded at the end."""

    # Flight, first row and end of each piece.
    pieces: tuple[tuple[int, int, int], ...]
    # (T, B) [s]; the last one of a piece is repeated.
    times: FloatArray
    # (T, B, 2) [m], NaN after its end.
    positions: FloatArray
    # (B,) standard deviation of a position across the velocity [m]
    across: FloatArray
    # (B,) standard deviation of its time [s]
    timing: FloatArray
    # (T, B) climb rates until each position [m/s], where they are known.
    climbs: FloatArray | None = None
    # First row and end of the part that counts; None: all.
    own: tuple[tuple[int, int], ...] | None = None

    @property
    def present(self) -> BoolArray:
        """(T, B) False after the end of a piece."""
        return ~np.isnan(self.positions[..., 0])

    @property
    def steps(self) -> FloatArray:
        """(T, B) time since the last position [s], 0 for the first one."""
        return np.diff(self.times, axis=0, prepend=self.times[:1])

    def unstack(self, values: NDArray[Any], lengths: Sequence[int]) -> list[NDArray[Any]]:
        """Return values (T, B, ...) as those of each flight, (n, ...), 0 outside of the pieces;
        lengths: numbers n.
        """
        flights = [np.zeros((length, *values.shape[2:]), values.dtype) for length in lengths]
        for column, (k, first, end) in enumerate(self.pieces):
            begin, stop = (first, end) if self.own is None else self.own[column]
            flights[k][begin:stop] = values[begin - first : stop - first, column]
        return flights

    def noise(self, velocities: FloatArray) -> FloatArray:
        """Return the covariances across^2 I + timing^2 v v' of positions, (..., B, 2, 2) [m^2],
        at velocities v.
        """
        along = (
            (self.timing**2)[:, None, None] * velocities[..., :, None] * velocities[..., None, :]
        )
        return np.asarray((self.across**2)[:, None, None] * np.eye(2) + along)


@dataclass(frozen=True, kw_only=True)
class TurnModel:
    """Settings of the filters; chosen for the largest agreement on simulated flights."""

    # Turn rates [deg/s], the first 0.
    rates: tuple[float, ...] = (0.0, 0.75, 1.5, 3.0, -0.75, -1.5, -3.0)
    # Spectral density of the white acceleration [m^2/s^3].
    acceleration: float = 0.2
    # Mean time in straight motion and in a turn [s].
    straight: float = 60.0
    # Mean time in straight motion and in a turn [s].
    turn: float = 40.0
    # Mean time between two turn rates of one direction [s].
    within: float = 15.0
    # Degrees of freedom nu of the Student t.
    freedom: float = 5.0
    # Spectral density of the random walk of the wind [m^2/s^3]; 0 is a state without wind.
    wind: float = 0.0
    # Logarithm of the likelihood of a turn that each metre above the level counts, 0 for none
    # [1/m].
    climb: float = 0.0
    # Climb rate that speaks neither for nor against a turn [m/s].
    climb_level: float = 0.0

    @property
    def values(self) -> int:
        """Number m of values of the state for each axis."""
        return 3 if self.wind else 2

    @property
    def modes(self) -> IntArray:
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
                if one == STRAIGHT:
                    matrix[i, j] = 1.0 / self.straight / max((modes != STRAIGHT).sum(), 1)
                elif other == one:
                    matrix[i, j] = 1.0 / self.within / max((modes == one).sum() - 1, 1)
                else:
                    # Most turns end in straight motion.
                    share = 0.9 if other == STRAIGHT else 0.1 / (modes == other).sum()
                    matrix[i, j] = share / self.turn
        np.fill_diagonal(matrix, 0.0)
        return np.asarray(matrix - np.diag(matrix.sum(1)))


class TurnStep(NamedTuple):
    """K filters of each of B pieces after a position; where there is none, they are only
    predicted.
    """

    # (B, K, n), n = 4 or with wind 6.
    state: FloatArray
    # (B, K, n, n)
    covariance: FloatArray
    # (B, K) of the position, 0 without one.
    log_likelihood: FloatArray
    # (B, n) of all filters before the position.
    mean: FloatArray
    # (B, 2, 2) covariance of the innovation of this mean, in each filter on average.
    spread: FloatArray


def start_turns(batch: Batch, count: int, model: TurnModel) -> tuple[FloatArray, FloatArray]:
    """Return states (B, K, n) and covariances (B, K, n, n) of K equal filters at the first
    positions.
    """
    tracks = batch.times.shape[1]
    m = model.values
    velocity = (batch.positions[1] - batch.positions[0]) / (batch.times[1] - batch.times[0])[
        :, None
    ]
    state = np.zeros((tracks, 1, 2 * m))
    state[:, 0, ::m], state[:, 0, 1::m] = batch.positions[0], velocity
    covariance = np.zeros((tracks, count, 2 * m, 2 * m))
    covariance[..., ::m, ::m] = batch.noise(velocity)[:, None]
    covariance[..., 1, 1] = covariance[..., m + 1, m + 1] = START_SPEED**2
    if model.wind:
        covariance[..., 2, 2] = covariance[..., 5, 5] = START_WIND**2
    return np.repeat(state, count, axis=1), covariance


def step_turns(
    batch: Batch,
    position: FloatArray,
    dt: FloatArray,
    state: FloatArray,
    covariance: FloatArray,
    rates: FloatArray,
    weights: FloatArray,
    model: TurnModel,
) -> TurnStep:
    """Predict the K filters of each piece by time steps (B,) and correct them by positions (B, 2),
    NaN without one. The filters have turn rates (K,) or (B, K) [rad/s] and probabilities `weights`,
    (B, K).
    """
    step = dt[:, None]
    m = model.values
    transition = turn_transition(rates, step)
    process = turn_noise(model.acceleration, step)
    if model.wind:
        transition, process = with_wind(transition, process, step, model.wind)
    state, covariance = propagate(state, covariance, transition, process, np.ones(1))
    mean = (weights[..., None] * state).sum(1)
    noise = batch.noise(ground_velocity(mean))
    spread = (weights[..., None, None] * covariance[..., ::m, ::m]).sum(1) + noise
    used = ~np.isnan(position[:, :1])
    measured = np.where(used, position, 0.0)[:, None]
    after = correct(
        state,
        covariance,
        measured,
        principal_noise(noise[:, None]),
        WholeStudentT(model.freedom),
    )
    return TurnStep(
        np.where(used[..., None], after.state, state),
        np.where(used[..., None, None], after.covariance, covariance),
        np.where(used, after.log_likelihood, 0.0),
        mean,
        spread,
    )


def with_wind(
    transition: FloatArray,
    noise: FloatArray,
    dt: FloatArray,
    density: float,
) -> tuple[FloatArray, FloatArray]:
    """Return transition matrices and covariances (..., 6, 6) of turns in a wind, from those
    without.
    """
    air = np.array([0, 1, 3, 4])
    moved, spread = (np.zeros((*values.shape[:-2], 6, 6)) for values in (transition, noise))
    moved[..., air[:, None], air], spread[..., air[:, None], air] = transition, noise
    for position, wind in ((0, 2), (3, 5)):
        moved[..., position, wind], moved[..., wind, wind] = dt, 1.0
        spread[..., wind, wind] = density * dt
    return moved, spread


def ground_velocity(state: FloatArray) -> FloatArray:
    """Return the velocity over the ground (..., 2) of states (..., 4), or with wind (..., 6)."""
    m = state.shape[-1] // 2
    return np.asarray(state[..., 1::m] + (state[..., 2::m] if m == 3 else 0.0))


class TurnEstimates(NamedTuple):
    """Output for T positions of B pieces."""

    # (T, B, 3) of straight motion, left and right turns.
    probabilities: FloatArray
    # (T, B, 3) of each position given its mode and all positions before.
    log_likelihoods: FloatArray
    # (T, B) mean turn rate [rad/s]
    rates: FloatArray
    # (T, B) speed [m/s]
    speeds: FloatArray
    # (T, B, 2) along and across the predicted velocity, in standard deviations.
    innovations: FloatArray


def run_turn_imm(batch: Batch, model: TurnModel | None = None) -> TurnEstimates:
    """Run the filter over pieces of flights; rows after the end of a piece repeat its last
    values.
    """
    settings = TurnModel() if model is None else model
    omega = np.radians(settings.rates)
    chain = ModelChain(settings.generator)
    # (3, M)
    groups = (settings.modes == np.arange(3)[:, None]).astype(np.float64)
    (total, tracks), steps, present = batch.times.shape, batch.steps, batch.present[..., None]
    state, covariance = start_turns(batch, len(omega), settings)
    log_probability = np.tile(np.log(settings.start), (tracks, 1))
    output = TurnEstimates(
        np.empty((total, tracks, 3)),
        np.zeros((total, tracks, 3)),
        np.zeros((total, tracks)),
        np.empty((total, tracks)),
        np.zeros((total, tracks, 2)),
    )
    for k in range(total):
        if k:
            log_probability, weights = mix_models(
                log_probability,
                chain.transition(steps[k]),
                SMALLEST,
            )
            probability = np.exp(log_probability)
            state, covariance = mixture(state, covariance, weights)
            now = step_turns(
                batch,
                batch.positions[k],
                steps[k],
                state,
                covariance,
                omega,
                probability,
                settings,
            )
            state, covariance = now.state, now.covariance
            likelihood = now.log_likelihood + climb_evidence(batch, settings, k)
            prior = np.log(np.maximum(probability @ groups.T, SMALLEST))
            joint = (log_probability + likelihood)[:, None] + np.where(groups > 0.0, 0.0, -np.inf)
            output.log_likelihoods[k] = np.where(present[k], log_sum(joint, 2) - prior, 0.0)
            output.innovations[k] = np.where(
                present[k],
                _turned(now.mean, now.spread, batch.positions[k]),
                0.0,
            )
            log_probability, _ = weigh_models(log_probability, likelihood, SMALLEST)
        probability = np.exp(log_probability)
        mean = (probability[..., None] * state).sum(1)
        output.probabilities[k] = probability @ groups.T
        output.rates[k] = probability @ omega
        output.speeds[k] = np.hypot(*ground_velocity(mean).T)
    return output


def climb_evidence(batch: Batch, model: TurnModel, k: int) -> FloatArray:
    """Return what the climb rates of row k add to the log-likelihoods of the models, (B, M) or
    (1, 1).
    """
    if batch.climbs is None or not model.climb:
        return np.zeros((1, 1))
    metres = (
        np.clip(batch.climbs[k] - model.climb_level, -CLIMB_RANGE, CLIMB_RANGE) * batch.steps[k]
    )
    return np.asarray(model.climb * metres[:, None] * (model.modes != STRAIGHT))


def _turned(mean: FloatArray, spread: FloatArray, z: FloatArray) -> FloatArray:
    """Return the innovation of the mean along and across the velocity, (B, 2), in standard
    deviations.
    """
    velocity = ground_velocity(mean)
    along = velocity / np.maximum(np.hypot(velocity[:, 0], velocity[:, 1]), 1e-9)[:, None]
    frame = np.stack([along, np.stack([-along[:, 1], along[:, 0]], -1)], -2)
    # 0 without a velocity.
    variances = np.maximum(np.einsum("bij,bjk,bik->bi", frame, spread, frame), 1e-300)
    return np.asarray(
        (frame @ (z - mean[:, :: mean.shape[1] // 2])[..., None])[..., 0] / np.sqrt(variances)
    )
