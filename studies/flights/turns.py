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

BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.int64]
FloatArray = NDArray[np.float64]

STRAIGHT, LEFT, RIGHT = 0, 1, 2
# Standard deviation of each component of the velocity at the start [m/s].
START_SPEED = 100.0
# Of the wind, if it is in the state [m/s].
START_WIND = 5.0
# Climb rates further from `TurnModel.climb_level` count as at this distance [m/s].
CLIMB_RANGE = 3.0
# Probability of a model.
SMALLEST = 1e-12
LOG_SMALLEST = float(np.log(SMALLEST))


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
        flights = [
            np.zeros(
                (length, *values.shape[2:]),
                values.dtype,
            )
            for length in lengths
        ]
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
    m = model.values
    transition, process = turn_motion(rates, dt[:, None], model)
    # The prediction of each filter, and the mean of all of them.
    state = (transition @ state[..., None])[..., 0]
    covariance = symmetric(transition @ covariance @ transition.swapaxes(-1, -2) + process)
    mean = (weights[..., None] * state).sum(1)
    noise = batch.noise(ground_velocity(mean))
    # The error of a position depends on the velocity, which is that of the mean.
    predicted = covariance[..., ::m, ::m]
    spread = (weights[..., None, None] * predicted).sum(1) + noise
    # Without a position the innovation does not matter.
    used = ~np.isnan(position[:, :1])
    innovation = np.where(used, position, 0.0)[:, None] - state[..., ::m]
    weight, log_likelihood = student_t(innovation, predicted + noise[:, None], model.freedom)
    # An outlier has a larger variance.
    cross = covariance[..., ::m]
    gain = cross @ np.linalg.inv(predicted + noise[:, None] / weight[..., None, None])
    corrected = state + (gain @ innovation[..., None])[..., 0]
    after = symmetric(covariance - gain @ cross.swapaxes(-1, -2))
    return TurnStep(
        np.where(used[..., None], corrected, state),
        np.where(used[..., None, None], after, covariance),
        np.where(used, log_likelihood, 0.0),
        mean,
        spread,
    )


def student_t(
    innovation: FloatArray,
    spread: FloatArray,
    freedom: float,
) -> tuple[FloatArray, FloatArray]:
    """Return weights, by which variances are divided, and log-likelihoods, (...) each, of
    innovations (..., 2) with a Student t distribution of covariances (..., 2, 2). The weight is the
    expected relative precision given the innovation, at most 1 (Lange, Little & Taylor 1989,
    eq. 4).
    """
    (a, b), (_, c) = np.moveaxis(spread, (-2, -1), (0, 1))
    x, y = np.moveaxis(innovation, -1, 0)
    determinant = a * c - b * b
    square = (c * x * x - 2.0 * b * x * y + a * y * y) / determinant
    shape = np.log1p(square / freedom) * (0.5 * freedom + 1.0)
    log_likelihood = -np.log(2.0 * np.pi) - 0.5 * np.log(determinant) - shape
    return np.minimum((freedom + 2.0) / (freedom + square), 1.0), log_likelihood


def symmetric(matrix: FloatArray) -> FloatArray:
    """Return matrices (..., n, n) without rounding errors that are not symmetric, which would
    grow.
    """
    return np.asarray(0.5 * (matrix + matrix.swapaxes(-1, -2)))


def turn_motion(
    rates: FloatArray,
    dt: FloatArray,
    model: TurnModel,
) -> tuple[FloatArray, FloatArray]:
    """Return transition matrices and covariances of the noise, (..., n, n), of turns with rates
    [rad/s] in steps [s], whose shapes broadcast.
    """
    m = model.values
    angle = rates * dt
    safe = np.where(rates == 0.0, 1.0, rates)
    sine = np.sin(angle)
    cosine = np.cos(angle)
    moved = np.zeros((*angle.shape, 2 * m, 2 * m))
    noise = np.zeros((*dt.shape, 2 * m, 2 * m))
    moved[..., 1, m + 1], moved[..., m + 1, 1] = -sine, sine
    moved[..., m, 1] = np.where(
        rates == 0.0,
        0.0,
        (1.0 - cosine) / safe,
    )
    moved[..., 0, m + 1] = -moved[..., m, 1]
    for x in (0, m):
        v = x + 1
        wind = x + 2
        moved[..., x, x], moved[..., v, v] = 1.0, cosine
        moved[..., x, v] = np.where(rates == 0.0, dt, sine / safe)
        noise[..., x, x] = model.acceleration * dt**3 / 3.0
        noise[..., x, v] = noise[..., v, x] = model.acceleration * dt**2 / 2.0
        noise[..., v, v] = model.acceleration * dt
        if model.wind:
            moved[..., x, wind], moved[..., wind, wind] = dt, 1.0
            noise[..., wind, wind] = model.wind * dt
    return moved, noise


def mixture(
    state: FloatArray,
    covariance: FloatArray,
    weights: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return mean and covariance of C mixtures, (B, C, n) and (B, C, n, n), of the same K normal
    distributions, (B, K, n) and (B, K, n, n), with weights (B, C, K).
    """
    mean = weights @ state
    # Relative to one of them, because positions are large.
    relative = state - state[:, :1]
    centre = mean - state[:, :1]
    squares = covariance + relative[..., :, None] * relative[..., None, :]
    mixed = np.einsum("bck,bkij->bcij", weights, squares, optimize=True)
    return mean, mixed - centre[..., :, None] * centre[..., None, :]


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
    # The chain of the models in continuous time.
    values, vectors = np.linalg.eig(settings.generator)
    inverse = np.linalg.inv(vectors)
    # (3, M)
    groups = settings.modes == np.arange(3)[:, None]
    (total, tracks), steps, present = batch.times.shape, batch.steps, batch.present[..., None]
    state, covariance = start_turns(batch, len(omega), settings)
    log_probability = np.tile(
        np.log(settings.start),
        (tracks, 1),
    )
    output = TurnEstimates(
        np.empty((total, tracks, 3)),
        np.zeros((total, tracks, 3)),
        np.zeros((total, tracks)),
        np.empty((total, tracks)),
        np.zeros((total, tracks, 2)),
    )
    for k in range(total):
        if k:
            # Mixing: every model begins with what the models before it leave.
            powers = np.exp(values * steps[k][:, None])
            transition = np.clip(
                np.real((vectors * powers[:, None]) @ inverse),
                0.0,
                1.0,
            )
            with np.errstate(divide="ignore"):
                # Before, after.
                joint = np.log(transition) + log_probability[:, :, None]
            prior = np.logaddexp.reduce(joint, axis=1)
            weights = np.exp(joint - prior[:, None]).swapaxes(1, 2)
            prior = np.maximum(prior, LOG_SMALLEST)
            now = step_turns(
                batch,
                batch.positions[k],
                steps[k],
                *mixture(state, covariance, weights),
                omega,
                np.exp(prior),
                settings,
            )
            state, covariance = now.state, now.covariance
            # Of the models, and of the three modes together.
            posterior = prior + now.log_likelihood + climb_evidence(batch, settings, k)
            of_mode = np.where(groups, posterior[:, None], -np.inf)
            share = np.exp(prior) @ groups.T
            before = np.log(np.maximum(share, SMALLEST))
            output.log_likelihoods[k] = np.where(
                present[k],
                np.logaddexp.reduce(of_mode, axis=2) - before,
                0.0,
            )
            output.innovations[k] = np.where(
                present[k],
                _turned(
                    now.mean,
                    now.spread,
                    batch.positions[k],
                ),
                0.0,
            )
            total_likelihood = np.logaddexp.reduce(posterior, axis=1)[:, None]
            log_probability = np.maximum(posterior - total_likelihood, LOG_SMALLEST)
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
        np.clip(
            batch.climbs[k] - model.climb_level,
            -CLIMB_RANGE,
            CLIMB_RANGE,
        )
        * batch.steps[k]
    )
    return np.asarray(model.climb * metres[:, None] * (model.modes != STRAIGHT))


def _turned(mean: FloatArray, spread: FloatArray, z: FloatArray) -> FloatArray:
    """Return the innovation of the mean along and across the velocity, (B, 2), in standard
    deviations.
    """
    velocity = ground_velocity(mean)
    along = (
        velocity
        / np.maximum(
            np.hypot(velocity[:, 0], velocity[:, 1]),
            1e-9,
        )[:, None]
    )
    frame = np.stack(
        [along, np.stack([-along[:, 1], along[:, 0]], -1)],
        -2,
    )
    # 0 without a velocity.
    variances = np.maximum(
        np.einsum("bij,bjk,bik->bi", frame, spread, frame),
        1e-300,
    )
    return np.asarray(
        (frame @ (z - mean[:, :: mean.shape[1] // 2])[..., None])[..., 0] / np.sqrt(variances)
    )
