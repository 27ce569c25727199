"""Estimates along known modes, given all measurements: a filter forwards and its adjoint backwards.

In straight motion and turns the state is [x, y, vx, vy, ux, uy, turn rate] of `turns`, whose radius
is not known exactly; in a linear mode [x, y, vx, vy, ax, ay, 0]. A segment begins with the position
and the velocity of the one before, and what else its mode says. The motion is linear but for the
turn rate, which does not change in a segment: it is linearised at the turn rate that the smoother
found before. The smoother is that of Bryson & Frazier 1963 in the form of Bierman 1973, "Fixed
interval smoothing with discrete measurements": it inverts no covariance of the state, which is
singular where a segment begins or an object stands.

Forwards, a tick predicts state x and covariance P by its step A. A measurement z of the position H
x, whose errors have the covariance R, corrects them:

    S = H P H' + R    K = P H' S^-1    x := x + K (z - H x)    P := (I - K H) P

Backwards, the adjoint l and the information L of all later ticks begin with 0. After the correction
of a tick the smoothed state is x - P l, and its covariance P - P L P. Then the tick itself adds
what it says, of the quantities forwards before the correction:

    l := A' ((I - K H)' l - H' S^-1 (z - H x))
    L := A' ((I - K H)' L (I - K H) + H' S^-1 H) A

Where a segment begins, A is the product of its first step and of the matrix by which its state
follows from that of the segment before. The filter of a block runs again before its way back, so
that memory does not grow with all that it remembers.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from baselines.estimation.turns import turn_of
from hybrid_env.checks import AnyArray, BoolArray, FloatArray, IntArray, Moments
from hybrid_env.compiled import compiled, internal, run_compiled

STATES = 7
# Places of x, vx, y, vy in the state, and of their covariance.
ORDER = [0, 2, 1, 3]
ORDER_OF_BOTH = np.ix_(ORDER, ORDER)
# Places of the own states in [x, vx, y, vy, ax, ay] of a linear mode.
LINEAR = [0, 2, 1, 3, 4, 5]
# Ticks of a block.
BLOCK = 512
# Relative deviation of the curvature of a turn from that of its mode.
SPREAD = 0.5
# Times that the turn rates are found anew.
ROUNDS = 3
# Ticks for which a turn may have half of its curvature at its begin.
GRADUAL = np.array([0, 2, 4, 8])
# Ticks between the begin of a piece and others with which it is compared.
REACH = 10


class Segments(NamedTuple):
    """What the K segments of a track are made of. Further rows are no part of the track: in
    `PieceSmoother.compare` the same segments with half the curvature.
    """

    # (T,) number of the segment of each tick.
    places: IntArray
    # (T,) True where one begins.
    begins: BoolArray
    # (K,) 1 / radius of the mode, positive to the left; 0 of others.
    curvatures: FloatArray
    # (K,) acceleration along the heading at the begin; NaN of straight motion and turns.
    accelerations: FloatArray
    # (K, 6, 6) by which the first six states move in a tick, its derivative by the turn rate, what
    # is added, and the covariance of the noise.
    F: FloatArray
    slopes: FloatArray
    B: FloatArray
    Q: FloatArray
    # (K,) turn rate at which the motion is linearised.
    rates: FloatArray


class Memory(NamedTuple):
    """What the filter remembers of the n ticks of a block."""

    # (n + 1, 7) and (n + 1, 7, 7), of which the first rows are those before the block.
    states: FloatArray
    covariances: FloatArray
    # (n, 7, 7) of the state by that of the tick before.
    steps: FloatArray
    # (n, 7, 2)
    gains: FloatArray
    # (n, 2) innovations, and (n, 2, 2) the inverses of their covariances, 0 without a measurement.
    errors: FloatArray
    inverses: FloatArray


@internal
def _begin(
    x: FloatArray, P: FloatArray, curvature: float, acceleration: float, speed: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Begin a segment at the estimate of the one before.

    Args:
        x: (7,) state of the segment before, of which position and velocity count.
        P: (7, 7) its covariance.
        curvature: of the mode, see `Segments`.
        acceleration: of the mode, likewise.
        speed: of a turn if the estimate does not tell it, as after a stop [m/s].

    Returns:
        State (7,), covariance (7, 7), and the matrix (7, 7) of the state by that before.
    """
    begun = np.zeros(STATES)
    begun[:4] = x[:4]
    J = np.zeros((STATES, STATES))
    J[:4, :4] = np.eye(4)
    known = math.hypot(x[2], x[3])
    along = x[2:4] / max(known, 1e-300)
    if math.isnan(acceleration):
        begun[4:6] = x[2:4]
        J[4:6, 2:4] = np.eye(2)
        if P[2, 2] + P[3, 3] < known**2:
            begun[6] = curvature * known
            J[6, 2:4] = curvature * along
        else:
            begun[6] = curvature * speed
    else:
        # Bounded as in `anchor_aware.begin_motion`.
        slope = acceleration / max(known, math.sqrt(P[2, 2] + P[3, 3]), 1e-12)
        begun[4:6] = acceleration * along
        J[4:6, 2:4] = slope * (np.eye(2) - np.outer(along, along))
    spread = J @ P @ J.T
    spread[6, 6] += (SPREAD * begun[6]) ** 2
    return begun, spread, J


@internal
def _predict(
    x: FloatArray, P: FloatArray, A: FloatArray, place: int, segments: Segments
) -> tuple[FloatArray, FloatArray]:
    """Return state and covariance after a tick of a segment, and write the matrix (7, 7) of the
    state by that before.
    """
    A[:6, :6] = segments.F[place]
    slope = segments.slopes[place] @ x[:6]
    A[:6, 6] = slope
    x = A @ x
    x[:6] += segments.B[place] - slope * segments.rates[place]
    P = A @ P @ A.T
    P[:6, :6] += segments.Q[place]
    return x, P


@internal
def _correct(
    x: FloatArray,
    P: FloatArray,
    measurement: FloatArray,
    noise: FloatArray,
    freedom: float,
    inverse: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, float]:
    """Return state and covariance after a measurement, the gain (7, 2), the innovation (2,), and
    the log-likelihood without its constant; of Student's t errors that of a normal one with the
    noise that is used.

    Args:
        x: (7,) predicted state.
        P: (7, 7) its covariance.
        measurement: (2,) position, NaN if there is none [m].
        noise: (3,) its covariance xx, xy, yy [m^2].
        freedom: of Student's t errors; 0 is normal ones.
        inverse: (2, 2) of the covariance of the innovation, 0 without a measurement, written.
    """
    if math.isnan(measurement[0]):
        inverse[:] = 0.0
        return x, P, np.zeros((STATES, 2)), np.zeros(2), 0.0
    error = measurement - x[:2]
    S = np.empty((2, 2))
    weight = 1.0
    # To a robust likelihood the noise of a measurement that is far is larger.
    for _ in range(2 if freedom > 0.0 else 1):
        xx, xy, yy = noise / weight
        S[0, 0], S[0, 1] = P[1, 1] + yy, -P[0, 1] - xy
        S[1, 0], S[1, 1] = S[0, 1], P[0, 0] + xx
        determinant = S[0, 0] * S[1, 1] - S[0, 1] * S[1, 0]
        inverse[:] = S / determinant
        distance = float(error @ (inverse @ error))
        weight = min((freedom + 2.0) / (freedom + distance), 1.0)
    gain = np.ascontiguousarray(P[:, :2]) @ inverse
    P = P - gain @ P[:2]
    log_likelihood = -0.5 * (distance + math.log(determinant))
    # Rounding errors that are not symmetric would grow.
    return x + gain @ error, 0.5 * (P + P.T), gain, error, log_likelihood


@compiled
def _filter(
    measurements: FloatArray,
    noises: FloatArray,
    first: int,
    segments: Segments,
    speed: float,
    freedom: float,
    memory: Memory,
) -> None:
    """Filter the ticks of a block and fill its memory.

    Args:
        measurements: (T, 2) positions up to the end of the block, NaN where there is none [m].
        noises: (T, 3) their covariances xx, xy, yy [m^2].
        first: number of the first tick of the block.
        segments: of the whole track.
        speed: as in `_begin`.
        freedom: of Student's t errors; 0 is normal ones.
        memory: its first rows have state and covariance before the block.
    """
    x = memory.states[0].copy()
    P = memory.covariances[0].copy()
    A, J = np.eye(STATES), np.eye(STATES)
    for k in range(len(measurements) - first):
        place = segments.places[first + k]
        begins = segments.begins[first + k]
        if begins:
            curvature, acceleration = segments.curvatures[place], segments.accelerations[place]
            x, P, J = _begin(x, P, curvature, acceleration, speed)
        x, P = _predict(x, P, A, place, segments)
        memory.steps[k] = A @ J if begins else A
        seen, noise = measurements[first + k], noises[first + k]
        x, P, gain, error, _ = _correct(x, P, seen, noise, freedom, memory.inverses[k])
        memory.gains[k] = gain
        memory.errors[k] = error
        memory.states[k + 1] = x
        memory.covariances[k + 1] = P


@compiled
def _compare(
    measurements: FloatArray,
    noises: FloatArray,
    pieces: IntArray,
    segments: Segments,
    speed: float,
    freedom: float,
    firsts: IntArray,
    states: FloatArray,
    covariances: FloatArray,
    gradual: IntArray,
    log_likelihoods: FloatArray,
) -> None:
    """Write how likely the measurements around the begin of each piece are if it begins elsewhere,
    or gradually.

    Args:
        measurements: as in `_filter`.
        noises: likewise.
        pieces: (K, 3) as in `PieceSmoother.smooth`.
        segments: of the pieces, and then the same with half the curvature.
        speed: as in `_begin`.
        freedom: as in `_filter`.
        firsts: (K,) first of the begins that are compared.
        states: (K, 7) before these ticks.
        covariances: (K, 7, 7) of the states.
        gradual: (G,) ticks with half the curvature.
        log_likelihoods: see `PieceSmoother.compare`, written.
    """
    A = np.eye(STATES)
    inverse = np.empty((2, 2))
    count = len(pieces)
    for k in range(1, count):
        begin, end = pieces[k, 0], pieces[k, 1]
        # All ways are the same of what is no turn.
        ways = len(gradual) if segments.curvatures[k] != 0.0 else 1
        x, P = states[k].copy(), covariances[k].copy()
        before = 0.0
        # The begin itself is always compared.
        for now in range(firsts[k], max(begin + 1, min(begin + REACH + 1, end - 1))):
            for g in range(ways):
                log_likelihood = before
                y, V = x, P
                whole = now + gradual[g]
                for tick in range(now, min(end, begin + 3 * REACH)):
                    place = k if tick >= whole else count + k
                    if tick in (now, whole):
                        curvature = segments.curvatures[place]
                        y, V, _ = _begin(y, V, curvature, segments.accelerations[place], speed)
                    y, V = _predict(y, V, A, place, segments)
                    seen = measurements[tick]
                    y, V, _, _, more = _correct(y, V, seen, noises[tick], freedom, inverse)
                    log_likelihood += more
                log_likelihoods[k, g:, now - begin + REACH] = log_likelihood
            # The piece before goes on.
            x, P = _predict(x, P, A, k - 1, segments)
            x, P, _, _, more = _correct(x, P, measurements[now], noises[now], freedom, inverse)
            before += more


@internal
def _smoothed(
    memory: Memory,
    k: int,
    adjoint: FloatArray,
    information: FloatArray,
    means: FloatArray,
    covariances: FloatArray,
) -> None:
    """Write state and covariance of tick k of a block, given its later ticks too."""
    P = memory.covariances[k + 1]
    means[k] = memory.states[k + 1] - P @ adjoint
    covariances[k] = P - P @ information @ P


@internal
def _go_back(memory: Memory, k: int, adjoint: FloatArray, information: FloatArray) -> None:
    """Bring what later ticks say to the begin of tick k of a block."""
    inverse = memory.inverses[k]
    step = memory.steps[k]
    seen = step[:2]
    # The step, and what the correction by the measurement leaves of it.
    left = step - memory.gains[k] @ seen
    adjoint[:] = left.T @ adjoint - seen.T @ (inverse @ memory.errors[k])
    information[:] = left.T @ information @ left + seen.T @ inverse @ seen


@compiled
def _return(
    memory: Memory,
    adjoint: FloatArray,
    information: FloatArray,
    means: FloatArray,
    covariances: FloatArray,
    turns: FloatArray,
) -> None:
    """Smooth a block that was filtered.

    Args:
        memory: of the block.
        adjoint: (7,) of the later blocks; it is brought to the begin of this one.
        information: (7, 7) likewise.
        means: (n, 7) smoothed states, written.
        covariances: (n, 7, 7) their covariances, written.
        turns: (n, 4) see `turns.Turn`, written.
    """
    for k in range(len(means) - 1, -1, -1):
        _smoothed(memory, k, adjoint, information, means, covariances)
        values = turn_of(means[k], covariances[k])
        for j in range(4):
            turns[k, j] = values[j]
        _go_back(memory, k, adjoint, information)


@compiled
def _smooth_first(
    measurements: FloatArray,
    noises: FloatArray,
    segments: Segments,
    speed: float,
    freedom: float,
    memory: Memory,
    means: FloatArray,
    covariances: FloatArray,
) -> None:
    """Smooth the first tick of a block; the arguments are those of `_filter` and `_return`."""
    _filter(measurements, noises, 0, segments, speed, freedom, memory)
    adjoint, information = np.zeros(STATES), np.zeros((STATES, STATES))
    for k in range(len(measurements) - 1, 0, -1):
        _go_back(memory, k, adjoint, information)
    _smoothed(memory, 0, adjoint, information, means, covariances)


def _matrices(rates: FloatArray, tau: float) -> Moments:
    """Return how turns move in a tick.

    Args:
        rates: (K,) turn rates [rad/s].
        tau: length of a tick [s].

    Returns:
        (K, 6, 6) matrices of position, v and u, as `turns.turn_matrix`, and their derivatives by
        the turn rates.
    """

    def matrices(rate: FloatArray) -> FloatArray:
        angle = rate * tau
        cosine, sine = np.cos(angle), np.sin(angle)
        along = tau * np.sinc(angle / np.pi)
        across = 0.5 * tau * angle * np.sinc(0.5 * angle / np.pi) ** 2
        F = np.zeros((len(rate), 6, 6))
        for k in range(2):
            # A left turn by 90 degrees moves coordinate `other` to k.
            other, sign = 1 - k, 2.0 * k - 1.0
            F[:, k, k] = 1.0
            F[:, k, 2 + k] = along
            F[:, k, 4 + other] = sign * across
            F[:, 2 + k, 2 + k] = F[:, 4 + k, 4 + k] = cosine
            F[:, 2 + k, 4 + other] = F[:, 4 + k, 2 + other] = sign * sine
        return F

    # Of the angle of a tick [rad], for which third derivatives have no weight.
    step = 1e-4 / tau
    return matrices(rates), (matrices(rates + step) - matrices(rates - step)) / (2.0 * step)


@dataclass(eq=False)
class PieceSmoother:
    """Estimates of an object whose modes are known, given all measurements.

    Attributes:
        measurements: (T, 2) positions [m], NaN where there is none.
        noises: (T, 3) their covariances xx, xy, yy [m^2].
        start: estimate (4,) and covariance (4, 4) one tick before the first measurement.
        motions: (M,) records `MOTION`.
        tau: length of a tick [s].
        process_variance: Q [m^2/s^2], of straight motion and turns.
        speed: usual one of the object [m/s], of turns after a stop or an unknown start.
        drift_variance: of the drift of the measured positions [m^2], as Q.
        freedom: of Student's t errors; 0 is normal ones.
    """

    measurements: FloatArray
    noises: FloatArray
    start: Moments
    motions: AnyArray
    tau: float
    process_variance: float
    speed: float
    drift_variance: float = 0.0
    freedom: float = 0.0

    def __post_init__(self) -> None:
        """Allocate the memory of a block."""
        self.pieces = np.empty((0, 3), int)
        self.rates = np.empty(0)
        ticks = min(BLOCK, len(self.measurements))
        self.memory = Memory(
            np.zeros((ticks + 1, STATES)),
            np.zeros((ticks + 1, STATES, STATES)),
            np.zeros((ticks, STATES, STATES)),
            np.zeros((ticks, STATES, 2)),
            np.zeros((ticks, 2)),
            np.zeros((ticks, 2, 2)),
        )

    def _segments(self, pieces: IntArray, of_pieces: AnyArray, rates: FloatArray) -> Segments:
        """Return the segments of pieces, (K, 3), with their records `MOTION` and turn rates."""
        linear = of_pieces["linear"]
        own = np.ix_(LINEAR, LINEAR)
        Q = np.zeros((len(of_pieces), 6, 6))
        Q[:, [0, 1], [0, 1]] = self.drift_variance
        Q[:, [2, 3], [2, 3]] = self.process_variance
        Q[linear] = of_pieces["Q"][linear][:, own[0], own[1]]
        B = np.where(linear[:, None], of_pieces["B"][:, LINEAR], 0.0)
        F, slopes = _matrices(rates, self.tau)
        F[linear], slopes[linear] = of_pieces["F"][linear][:, own[0], own[1]], 0.0
        begins = np.zeros(len(self.measurements), bool)
        begins[pieces[:, 0]] = True
        places = np.repeat(np.arange(len(pieces)), pieces[:, 1] - pieces[:, 0])
        accelerations = np.where(linear, of_pieces["acceleration"], np.nan)
        curvatures = _curvatures(of_pieces)
        return Segments(places, begins, curvatures, accelerations, F, slopes, B, Q, rates)

    def _filter(self, first: int, segments: Segments) -> int:
        """Filter the block that begins at a tick, and return the number of its ticks."""
        end = min(first + BLOCK, len(self.measurements))
        arguments = self.measurements[:end], self.noises, first, segments
        run_compiled(_filter, *arguments, self.speed, self.freedom, self.memory)
        return end - first

    def begin(self) -> Moments:
        """Return state (7,) and covariance (7, 7) before the first segment, of the start."""
        x, P = np.zeros(STATES), np.zeros((STATES, STATES))
        x[:4], P[:4, :4] = self.start[0][ORDER], self.start[1][ORDER_OF_BOTH]
        return x, P

    def _anchor(self, state: FloatArray, covariance: FloatArray) -> None:
        """Let the next block begin with these."""
        self.memory.states[0], self.memory.covariances[0] = state, covariance

    def smooth(
        self, pieces: IntArray, gradual: IntArray | None = None
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return estimates (T, 4) [x, vx, y, vy], covariances (T, 4, 4) and turns (T, 4), see
        `turns.Turn`.

        Args:
            pieces: (K, 3) first tick, end, and row of `motions` of the segments.
            gradual: (K,) ticks for which a segment has half its curvature at its begin; None is 0.
        """
        ticks = len(self.measurements)
        of_pieces = self.motions[pieces[:, 2]]
        if gradual is not None:
            split = (gradual > 0) & (np.diff(pieces[:, :2])[:, 0] > gradual)
            numbers = np.repeat(np.arange(len(pieces)), 1 + split)
            second = np.diff(numbers, prepend=-1) == 0
            first = split[numbers] & ~second
            pieces, of_pieces, gradual = pieces[numbers], of_pieces[numbers], gradual[numbers]
            of_pieces["signed_radius"][first] *= 2.0
            pieces[second, 0] += gradual[second]
            pieces[first, 1] = pieces[first, 0] + gradual[first]
        memory = self.memory
        means, spreads = np.empty((BLOCK, STATES)), np.empty((BLOCK, STATES, STATES))
        results = np.empty((ticks, 4)), np.empty((ticks, 4, 4)), np.empty((ticks, 4))
        self.pieces = pieces
        self.rates = _curvatures(of_pieces) * self.speed
        for _ in range(ROUNDS):
            segments = self._segments(pieces, of_pieces, self.rates)
            self._anchor(*self.begin())
            anchors = []
            for first in range(0, ticks, BLOCK):
                anchors.append((memory.states[0].copy(), memory.covariances[0].copy()))
                count = self._filter(first, segments)
                self._anchor(memory.states[count], memory.covariances[count])
            adjoint, information = np.zeros(STATES), np.zeros((STATES, STATES))
            found = np.zeros(ticks)
            for first, anchor in zip(range(0, ticks, BLOCK)[::-1], anchors[::-1], strict=True):
                self._anchor(*anchor)
                count = self._filter(first, segments)
                part = slice(first, first + count)
                smoothed = means[:count], spreads[:count], results[2][part]
                run_compiled(_return, memory, adjoint, information, *smoothed)
                results[0][part] = means[:count, ORDER]
                results[1][part] = spreads[:count][:, ORDER_OF_BOTH[0], ORDER_OF_BOTH[1]]
                found[part] = means[:count, 6]
            self.rates = found[pieces[:, 1] - 1]
        results[2][of_pieces["linear"][segments.places], 2:] = np.nan
        return results

    @cached_property
    def _modes(self) -> Segments:
        """Segments of all modes, of which the track has none yet."""
        rates = _curvatures(self.motions) * self.speed
        return self._segments(np.empty((0, 3), int), self.motions, rates)

    def smooth_first(
        self, modes: IntArray, begins: BoolArray, before: Moments
    ) -> tuple[FloatArray, FloatArray, Moments]:
        """Return estimate (4,) and covariance (4, 4) of the first tick given the measurements of
        all, at most `BLOCK`, and its state (7,) and covariance (7, 7) given its own.

        Args:
            modes: (T,) of the ticks.
            begins: (T,) True where a segment begins.
            before: state and covariance one tick before.
        """
        self._anchor(*before)
        segments = self._modes._replace(places=modes, begins=begins)
        means, spreads = np.empty((1, STATES)), np.empty((1, STATES, STATES))
        arguments = self.measurements, self.noises, segments, self.speed, self.freedom
        run_compiled(_smooth_first, *arguments, self.memory, means, spreads)
        after = self.memory.states[1].copy(), self.memory.covariances[1].copy()
        return means[0, ORDER], spreads[0][ORDER_OF_BOTH], after

    def compare(self) -> FloatArray:
        """Return log-likelihoods of what is measured around the begins of the pieces that were
        smoothed last, (K, G, 2 REACH + 1): if the first ticks of a turn, see `GRADUAL`, have half
        its curvature, and if a piece begins up to `REACH` ticks before or after; -inf where it
        cannot, and for the first piece.
        """
        pieces = self.pieces
        of_pieces = self.motions[pieces[:, 2]]
        half = of_pieces.copy()
        half["signed_radius"] *= 2.0
        rates = np.concatenate([self.rates, 0.5 * self.rates])
        segments = self._segments(pieces, np.concatenate([of_pieces, half]), rates)
        firsts = pieces[:, 0] - REACH
        firsts[1:] = np.maximum(firsts[1:], pieces[:-1, 0] + 1)
        states = np.zeros((len(pieces), STATES))
        covariances = np.zeros((len(pieces), STATES, STATES))
        memory = self.memory
        self._anchor(*self.begin())
        for first in range(0, len(self.measurements), BLOCK):
            count = self._filter(first, segments)
            here = np.flatnonzero((firsts >= first) & (firsts < first + count))
            states[here] = memory.states[firsts[here] - first]
            covariances[here] = memory.covariances[firsts[here] - first]
            self._anchor(memory.states[count], memory.covariances[count])
        compared = np.full((len(pieces), len(GRADUAL), 2 * REACH + 1), -np.inf)
        arguments = self.measurements, self.noises, pieces, segments, self.speed, self.freedom
        run_compiled(_compare, *arguments, firsts, states, covariances, GRADUAL, compared)
        return compared


def _curvatures(of_pieces: AnyArray) -> FloatArray:
    """Return 1 / radius of records `MOTION`, 0 of straight motion."""
    radii = of_pieces["signed_radius"]
    return np.divide(1.0, radii, out=np.zeros(len(radii)), where=radii != 0.0)
