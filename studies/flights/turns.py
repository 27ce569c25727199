"""Filters of coordinated turns with known turn rates, and the interacting multiple model of them.
The states are [x, vx, y, vy]; with wind [x, vx, wx, y, vy, wy]: the velocity v in the air turns,
and the wind w, a random walk, carries the object along. The covariance of a measurement is across^2
I + timing^2 v v' with the predicted velocity v, and its distribution a Student t. Pieces of several
flights are columns of arrays.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from baselines import mixture
from studies.filters.motion_models import MotionModel

BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.int64]
FloatArray = NDArray[np.float64]

STRAIGHT, LEFT, RIGHT = 0, 1, 2
# Probability of a model.
SMALLEST = 1e-12


class Batch(NamedTuple):
    """B pieces of flights of at most T positions, padded at the end."""

    # First row of each flight among those of all, and their number.
    offsets: IntArray
    # (T, B) row of each position among those of all flights; the last one of a piece is repeated.
    rows: IntArray
    # (T, B) False after the end of a piece.
    present: BoolArray
    # (T, B) False there, and in margins.
    counted: BoolArray
    # (T, B) [s]; the last one of a piece is repeated.
    times: FloatArray
    # (T, B, 2) [m], NaN after its end.
    positions: FloatArray
    # (T, B) climb rates until each position [m/s], 0 where they are not known.
    climbs: FloatArray
    # (B,) standard deviation of a position across the velocity [m]
    across: FloatArray
    # (B,) standard deviation of its time [s]
    timing: FloatArray

    @property
    def steps(self) -> FloatArray:
        """(T, B) time since the last position [s], 0 for the first one."""
        return np.diff(self.times, axis=0, prepend=self.times[:1])

    def unstack(self, values: NDArray[Any]) -> list[NDArray[Any]]:
        """Return values (T, B, ...) as those of each flight, (n, ...), 0 outside of the pieces."""
        flights = np.zeros((self.offsets[-1], *values.shape[2:]), values.dtype)
        flights[self.rows[self.counted]] = values[self.counted]
        return np.split(flights, self.offsets[1:-1])

    def noise(self, velocities: FloatArray) -> FloatArray:
        """Return the covariances across^2 I + timing^2 v v' of positions, (..., B, 2, 2) [m^2],
        at velocities v.
        """
        across, timing = (part[:, None, None] ** 2 for part in (self.across, self.timing))
        along = timing * velocities[..., :, None] * velocities[..., None, :]
        return across * np.eye(2) + along


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
        return np.array([STRAIGHT, LEFT, RIGHT])[np.sign(self.rates).astype(np.int64)]

    @property
    def start(self) -> FloatArray:
        """(M,) probabilities of the models at the start of a piece: straight motion is likely."""
        others = len(self.rates) - 1
        return np.array([0.9, *[0.1 / others] * others]) if others else np.ones(1)

    @property
    def generator(self) -> FloatArray:
        """(M, M) rates of change between the models [1/s]; rows sum to 0."""
        modes = self.modes
        alike = modes[:, None] == modes
        count = alike.sum(0)
        # Most turns end in straight motion.
        ends = np.where(modes == STRAIGHT, 0.9, 0.1 / count) / self.turn
        matrix = np.where(alike, 1.0 / self.within / np.maximum(count - 1, 1), ends)
        matrix[modes == STRAIGHT] = 1.0 / self.straight / max((modes != STRAIGHT).sum(), 1)
        np.fill_diagonal(matrix, 0.0)
        return matrix - np.diag(matrix.sum(1))


def start_turns(
    batch: Batch, count: int, model: TurnModel, speed: float = 100.0, wind: float = 5.0
) -> tuple[FloatArray, FloatArray]:
    """Return states (B, K, n) and covariances (B, K, n, n) of K equal filters at the first
    positions; `speed` and `wind` are standard deviations of the components of velocities [m/s].
    """
    m = model.values
    moved, passed = (np.diff(values[:2], axis=0)[0] for values in (batch.positions, batch.times))
    velocity = moved / passed[:, None]
    state = np.zeros((len(velocity), count, 2 * m))
    state[..., ::m], state[..., 1::m] = batch.positions[0, :, None], velocity[:, None]
    variances = np.tile([0.0, speed**2, wind**2][:m], 2)
    covariance = np.tile(np.diag(variances), (len(velocity), count, 1, 1))
    covariance[..., ::m, ::m] = batch.noise(velocity)[:, None]
    return state, covariance


def step_turns(
    batch: Batch,
    k: int,
    dt: FloatArray,
    state: FloatArray,
    covariance: FloatArray,
    rates: FloatArray,
    weights: FloatArray,
    model: TurnModel,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Predict the K filters of each piece by time steps (B,) and correct them by positions k; where
    there is none, they are only predicted. The filters have turn rates (K,) or (B, K) [rad/s] and
    probabilities `weights`, (B, K).

    Returns:
        states (B, K, n), n = 4 or with wind 6, covariances (B, K, n, n), log-likelihoods (B, K) of
        position and climb rate, and innovations (B, 2) of the mean of all filters along and across
        its velocity, in standard deviations, 0 without a velocity.
    """
    m = model.values
    transition, process = turn_motion(rates, dt[:, None], model)
    # The prediction of each filter, and the mean of all of them.
    state = (transition @ state[..., None])[..., 0]
    covariance = symmetric(transition @ covariance @ transition.swapaxes(-1, -2) + process)
    mean = (weights[..., None] * state).sum(1)
    velocity = ground_velocity(mean)
    # The error of a position depends on the velocity, which is that of the mean.
    noise = batch.noise(velocity)
    predicted = covariance[..., ::m, ::m]
    # Without a position the innovation does not matter.
    used = batch.present[k, :, None]
    position = np.where(used, batch.positions[k], 0.0)
    innovation = position[:, None] - state[..., ::m]
    weight, log_likelihood = student_t(innovation, predicted + noise[:, None], model.freedom)
    # An outlier has a larger variance.
    cross = covariance[..., ::m]
    gain = cross @ np.linalg.inv(predicted + noise[:, None] / weight[..., None, None])
    corrected = state + (gain @ innovation[..., None])[..., 0]
    after = symmetric(covariance - gain @ cross.swapaxes(-1, -2))
    # Gliders turn where the air rises; climb rates count within 3 m/s of the level.
    metres = np.clip(batch.climbs[k] - model.climb_level, -3.0, 3.0) * dt
    evidence = model.climb * metres[:, None] * (rates != 0.0)
    spread = (weights[..., None, None] * predicted).sum(1) + noise
    along = velocity / np.maximum(np.hypot(*velocity.T), 1e-9)[:, None]
    frame = np.stack([along, along[:, ::-1] * [-1.0, 1.0]], -2)
    variances = np.einsum("bij,bjk,bik->bi", frame, spread, frame)
    turned = (frame @ (position - mean[:, ::m])[..., None])[..., 0]
    return (
        np.where(used[..., None], corrected, state),
        np.where(used[..., None, None], after, covariance),
        np.where(used, log_likelihood, 0.0) + evidence,
        np.where(used, turned / np.sqrt(np.maximum(variances, 1e-300)), 0.0),
    )


def student_t(
    innovation: FloatArray, spread: FloatArray, freedom: float
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
    return 0.5 * (matrix + matrix.swapaxes(-1, -2))


def turn_motion(
    rates: FloatArray, dt: FloatArray, model: TurnModel
) -> tuple[FloatArray, FloatArray]:
    """Return transition matrices and covariances of the noise, (..., n, n), of turns with rates
    [rad/s] in steps [s], whose shapes broadcast.
    """
    moved = turn_transition(rates, dt)
    # White acceleration in both axes.
    plain = MotionModel("CV", 2, model.acceleration)
    both = model.acceleration * np.kron(np.eye(2), plain.step_noise(dt))
    noise = np.asarray(both, np.float64)
    if model.wind:
        # It stands behind position and velocity of each axis, and moves the position.
        for axis in (-2, -1):
            moved = np.insert(moved, (2, 4), 0.0, axis)
            noise = np.insert(noise, (2, 4), 0.0, axis)
        for x in (0, 3):
            moved[..., x, x + 2] = dt
            moved[..., x + 2, x + 2] = 1.0
            noise[..., x + 2, x + 2] = model.wind * dt
    return moved, noise


def ground_velocity(state: FloatArray) -> FloatArray:
    """Return the velocity over the ground (..., 2) of states (..., 4), or with wind (..., 6)."""
    m = state.shape[-1] // 2
    return state[..., 1::m] + (state[..., 2::m] if m == 3 else 0.0)


def turn_transition(rates: FloatArray, dt: FloatArray) -> FloatArray:
    """Return the transition matrices (..., 4, 4) of coordinated turns, of a state [x, vx, y, vy].
    Turn rates [rad/s], anticlockwise positive, 0 is straight motion, and time steps [s] have shapes
    that broadcast.
    """
    angle = rates * dt
    moving = rates != 0.0
    safe = np.where(moving, rates, 1.0)
    # Of complex positions and velocities x + i y, whose parts are the blocks of the matrix.
    factors = np.zeros((*angle.shape, 2, 2), np.complex128)
    factors[..., 0, 0] = 1.0
    factors[..., 0, 1] = (
        np.where(moving, np.sin(angle) / safe, dt) + 1j * (1.0 - np.cos(angle)) / safe
    )
    factors[..., 1, 1] = np.cos(angle) + 1j * np.sin(angle)
    return np.block([[factors.real, -factors.imag], [factors.imag, factors.real]])


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


def run_turn_imm(batch: Batch, model: TurnModel) -> TurnEstimates:
    """Run the filter over pieces of flights; rows after the end of a piece repeat its last
    values.
    """
    omega = np.radians(model.rates)
    # (3, M)
    groups = model.modes == np.arange(3)[:, None]
    # Of the Markov chain in continuous time.
    changes, vectors = np.linalg.eig(model.generator)
    inverse = np.linalg.inv(vectors)
    state, covariance = start_turns(batch, len(omega), model)
    log_probability = np.tile(np.log(model.start), (len(state), 1))
    of_modes = np.zeros((len(state), 3))
    innovation = np.zeros((len(state), 2))
    rows = []
    for k, dt in enumerate(batch.steps):
        if k:
            powers = np.exp(changes * dt[:, None])
            transition = np.real((vectors * powers[:, None]) @ inverse)
            # Mixing: every model begins with what the models before it leave.
            with np.errstate(divide="ignore"):
                # Before, after.
                joint = np.log(np.clip(transition, 0.0, 1.0)) + log_probability[:, :, None]
            prior = logsumexp(joint, axis=1)
            weights = np.exp(joint - prior[:, None]).swapaxes(1, 2)
            prior = np.maximum(prior, np.log(SMALLEST))
            mixed = mixture(state, covariance, weights)
            state, covariance, log_likelihood, innovation = step_turns(
                batch, k, dt, *mixed, omega, np.exp(prior), model
            )
            # Of the models, and of the three modes together.
            posterior = prior + log_likelihood
            total = logsumexp(posterior, axis=1, keepdims=True)
            log_probability = np.maximum(posterior - total, np.log(SMALLEST))
            joint = np.where(groups, posterior[:, None], -np.inf)
            before = np.log(np.maximum(np.exp(prior) @ groups.T, SMALLEST))
            of_modes = np.logaddexp.reduce(joint, axis=2) - before
        probability = np.exp(log_probability)
        velocity = ground_velocity((probability[..., None] * state).sum(1))
        rows.append(
            (
                probability @ groups.T,
                np.where(batch.present[k, :, None], of_modes, 0.0),
                probability @ omega,
                np.hypot(*velocity.T),
                innovation,
            )
        )
    return TurnEstimates(*map(np.array, zip(*rows, strict=True)))
