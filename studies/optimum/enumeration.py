"""The posterior of the mode over every history of switches: nothing is merged, nothing is omitted.

Without process noise, and with a known start, a history of modes is one path, and its likelihood
is that of the errors of the measurements. With process noise it has a Kalman filter, which is exact
once the speed at the beginning of every turn is given: centre and turn rate then follow linearly
from the state. The mean over this speed is taken at the nodes of a Gauss-Hermite formula.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid_env import QuickestOptions
from studies.arrays import FloatArray, IntArray


def curvatures(options: QuickestOptions) -> FloatArray:
    """Return the curvature of every mode, (M,), positive to the left [1/m]."""
    inverse = 1.0 / np.array(options.radii)
    return np.concatenate([[0.0], inverse, -inverse])


def path_posteriors(
    options: QuickestOptions, measurements: FloatArray, smoothed: bool = False
) -> FloatArray:
    """Return the logarithms of the posteriors of the modes, (N, T, M), from measurements (N, T, 2)
    of objects without process noise, whose start is known but for the mode. Durations are
    geometric, so that the modes are a Markov chain. All M^T sequences of modes are paths. Smoothed,
    a posterior is given all measurements, else those up to its tick.
    """
    M = options.hypotheses
    turned = 1j * options.tau * options.speed * curvatures(options)
    rotation = np.exp(turned)
    # Displacement of a tick over the velocity before it.
    chord = np.full(M, options.tau, np.complex128)
    chord[1:] *= (rotation[1:] - 1.0) / turned[1:]
    position = np.zeros(1, np.complex128)
    velocity = np.array([options.speed * np.exp(1j * heading_of(options))])
    paths = []
    for _ in range(measurements.shape[1]):
        position = (position[:, None] + chord * velocity[:, None]).ravel()
        velocity = (velocity[:, None] * rotation).ravel()
        paths.append(position)
    points = measurements @ np.array([1.0, 1j])
    chain = np.log(options.transition_matrix)
    posteriors = np.empty((*points.shape, M))
    for track, of_track in enumerate(points):
        weights = np.full(M, -math.log(M))
        for tick, (position, point) in enumerate(zip(paths, of_track, strict=True)):
            if tick > 0:
                # The last mode of path k is k mod M.
                weights = (weights.reshape(-1, M, 1) + chain).ravel()
            error = position - point
            square = error.real**2 + error.imag**2
            weights = weights - 0.5 * square / options.variances[0]
            posteriors[track, tick] = sum_by_mode(weights.reshape(-1, M))
        for tick in range(len(paths) if smoothed else 0):
            of_tick = weights.reshape(M**tick, M, -1).swapaxes(1, 2)
            posteriors[track, tick] = sum_by_mode(of_tick.reshape(-1, M))
    return posteriors


def heading_of(options: QuickestOptions) -> float:
    """Return the heading at the start, which must be known [rad]."""
    assert options.heading is not None
    return options.heading


def sum_by_mode(logs: FloatArray) -> FloatArray:
    """Return the logarithms of the shares of the columns, (M,), of numbers with logarithms (n,
    M).
    """
    sums = np.exp(logs - logs.max()).sum(0)
    with np.errstate(divide="ignore"):
        return np.asarray(np.log(sums / sums.sum()))


class Histories(NamedTuple):
    """Histories of switches with their filters.

    The state is [x, y, vx, vy, cx, cy], where (cx, cy) is the centre of a turn; it has no meaning
    in straight motion.
    """

    # (n,) logarithms of their probabilities.
    weight: FloatArray
    # (n,) present mode.
    mode: IntArray
    # (n,) ticks of the present segment so far.
    age: IntArray
    # (n,) 0 in the first segment, else 1.
    later: IntArray
    # (n, 6)
    mean: FloatArray
    # (n, 6, 6)
    P: FloatArray
    # (n, 6, 6) transition matrix.
    F: FloatArray
    # (n, T) mode at each tick so far.
    past: IntArray

    def some(self, chosen: NDArray[np.bool_]) -> "Histories":
        """Return the histories that a mask selects."""
        return Histories._make(array[chosen] for array in self)


def joined(parts: list[Histories]) -> Histories:
    """Return the histories of several groups."""
    return Histories._make(np.concatenate(arrays) for arrays in zip(*parts, strict=True))


def transition(turn_rate: FloatArray, tau: float) -> FloatArray:
    """Return the transition matrices (n, 6, 6) of turns with turn rates (n,) [rad/s], 0 if
    straight. Golubkov 2018, eq. (1).
    """
    angle = turn_rate * tau
    C = np.cos(angle)
    # sin(angle) / turn rate.
    S = tau * np.sinc(angle / np.pi)
    W = turn_rate * np.sin(angle)
    of_axis = np.zeros((len(angle), 3, 3))
    of_axis[:, 0] = np.stack([C, S, 1.0 - C], axis=1)
    of_axis[:, 1] = np.stack([-W, C, W], axis=1)
    of_axis[:, 2, 2] = 1.0
    return np.asarray(np.kron(of_axis, np.eye(2)))


def begin(before: Histories, mode: int, options: QuickestOptions, nodes: int) -> Histories:
    """Return histories with the weights of those before that begin a segment of a mode; of a turn
    each becomes as many as there are nodes.
    """
    curvature = curvatures(options)[mode]
    mean = before.mean[:, :4]
    P = before.P[:, :4, :4]
    weight = before.weight
    past = before.past
    turn_rate = np.zeros(len(weight))
    if curvature != 0.0:
        places, shares = np.polynomial.hermite_e.hermegauss(nodes)
        place = np.tile(places, len(weight))
        share = np.tile(shares / shares.sum(), len(weight))
        mean = np.repeat(mean, nodes, axis=0)
        P = np.repeat(P, nodes, axis=0)
        weight = np.repeat(weight, nodes) + np.log(share)
        past = np.repeat(past, nodes, axis=0)
        speed = np.hypot(mean[:, 2], mean[:, 3])[:, None]
        along = np.zeros_like(mean)
        along[:, 2:] = mean[:, 2:] / speed
        across = np.zeros_like(mean)
        across[:, 2:] = along[:, [3, 2]] * [-1.0, 1.0]
        # Mean and covariance, given that the speed along the heading has its value at a node.
        covariance = product(P, along)
        deviation = np.sqrt((covariance * along).sum(1, keepdims=True))
        gain = covariance / np.where(deviation > 0.0, deviation, 1.0)
        mean = mean + gain * place[:, None]
        P = P - gain[:, :, None] * gain[:, None]
        forward = (mean * along).sum(1)
        # The component across enters by its mean square.
        sideways = (mean * across).sum(1) ** 2 + (product(P, across) * across).sum(1)
        turn_rate = curvature * np.sqrt(forward**2 + sideways)
    n = len(weight)
    # The new state is linear in the old one.
    A = np.zeros((n, 6, 4))
    A[:, range(4), range(4)] = 1.0
    if curvature != 0.0:
        A[:, 4, 0] = 1.0
        A[:, 5, 1] = 1.0
        A[:, 4, 3] = -1.0 / turn_rate
        A[:, 5, 2] = 1.0 / turn_rate
    return Histories(
        weight,
        np.full(n, mode),
        np.ones(n, np.int64),
        np.ones(n, np.int64),
        product(A, mean),
        A @ P @ A.swapaxes(1, 2),
        transition(turn_rate, options.tau),
        past,
    )


def product(matrices: FloatArray, vectors: FloatArray) -> FloatArray:
    """Return the products of n matrices and n vectors."""
    return np.asarray((matrices @ vectors[:, :, None])[:, :, 0])


def continued(now: Histories, options: QuickestOptions, nodes: int) -> Histories:
    """Return all continuations of histories before the next tick."""
    laws = options.duration_laws
    # Probability that a segment is at least as old.
    reached = 1.0 - np.cumsum(laws, axis=1) + laws
    hazard = laws / np.where(reached > 1e-12, reached, 1.0)
    ends = hazard[now.later * (len(hazard) // 2) + options.law_places[now.mode], now.age - 1]
    lasting = now.some(ends < 1.0)
    parts = [
        lasting._replace(weight=lasting.weight + np.log1p(-ends[ends < 1.0]), age=lasting.age + 1)
    ]
    for mode in range(options.hypotheses):
        probability = ends * options.next_mode_matrix[now.mode, mode]
        possible = probability > 0.0
        parents = now.some(possible)
        weight = parents.weight + np.log(probability[possible])
        parts.append(begin(parents._replace(weight=weight), mode, options, nodes))
    return joined(parts)


def moved(now: Histories, measured: FloatArray, options: QuickestOptions) -> Histories:
    """Return histories after a tick: their filters are predicted and corrected by the measurement,
    (2,), whose likelihood multiplies their probabilities.
    """
    Q = np.diag([0.0, 0.0, 1.0, 1.0, 0.0, 0.0]) * options.process_variance
    R = np.eye(2) * options.variances[0]
    mean = product(now.F, now.mean)
    P = now.F @ now.P @ now.F.swapaxes(1, 2) + Q
    S = P[:, :2, :2] + R
    inverse = np.linalg.inv(S)
    innovation = measured - mean[:, :2]
    square = (innovation * product(inverse, innovation)).sum(1)
    log_likelihood = -0.5 * (square + np.log(np.linalg.det(S)))
    K = P[:, :, :2] @ inverse
    return now._replace(
        weight=now.weight + log_likelihood, mean=mean + product(K, innovation), P=P - K @ P[:, :2]
    )


def history_posteriors(
    options: QuickestOptions,
    measurements: FloatArray,
    first: int | None = None,
    nodes: int = 7,
    smoothed: bool = False,
) -> FloatArray:
    """Return the logarithms of the posteriors of the modes, (T, M), from measurements (T, 2) of an
    object with process noise and a known start.

    Args:
        options: of the environment, with a heading.
        measurements: of one track.
        first: mode of the first segment; None if it is not known.
        nodes: number of speeds at the beginning of a turn.
        smoothed: whether a posterior is given all measurements, else those up to its tick.
    """
    M = options.hypotheses
    angle = heading_of(options)
    heading = math.cos(angle), math.sin(angle)
    start = Histories(
        np.zeros(1),
        np.zeros(1, np.int64),
        np.zeros(1, np.int64),
        np.zeros(1, np.int64),
        options.speed * np.array([[0.0, 0.0, *heading, 0.0, 0.0]]),
        np.zeros((1, 6, 6)),
        np.zeros((1, 6, 6)),
        np.zeros((1, len(measurements)), np.int64),
    )
    # The speed at the start is known.
    parts = [begin(start, mode, options, 1) for mode in range(M) if first in (None, mode)]
    now = joined(parts)
    now = now._replace(later=np.zeros_like(now.later))
    posteriors = np.empty((len(measurements), M))
    for tick, measured in enumerate(measurements):
        if tick > 0:
            now = continued(now, options, nodes)
        now = moved(now, measured, options)
        now.past[:, tick] = now.mode
        posteriors[tick] = _of_modes(now.mode, now.weight, M)
    for tick in range(len(measurements) if smoothed else 0):
        posteriors[tick] = _of_modes(now.past[:, tick], now.weight, M)
    return posteriors


def _of_modes(modes: IntArray, weights: FloatArray, M: int) -> FloatArray:
    """Return the logarithms of the shares of modes, (M,), of histories (n,)."""
    logs = np.full((len(modes), M), -np.inf)
    logs[np.arange(len(modes)), modes] = weights
    return sum_by_mode(logs)
