"""Filter along known modes and its adjoint backwards; compiled code.

In straight motion and turns the state is [x, y, vx, vy, ux, uy, turn rate] of `turns`, whose radius
is not known exactly; in a linear mode [x, y, vx, vy, ax, ay, 0]. A segment begins with the position
and the velocity of the one before, and what else its mode says. The motion is linear but for the
turn rate, which does not change in a segment: it is linearised at the turn rate that the smoother
found before. The smoother is that of Bryson & Frazier 1963 in the form of Bierman 1973, "Fixed
interval smoothing with discrete measurements": it inverts no covariance of the state, which is
singular where a segment begins or an object stands.

Forwards, a tick predicts state x and covariance P by its step A. A measurement z of the position H
x, or of position and velocity, whose errors have the covariance R, corrects them:

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
from typing import NamedTuple

import numpy as np

from baselines.estimation.turns import STATES, turn_of
from hybrid_env.checks import BoolArray, FloatArray, IntArray
from hybrid_env.compiled import compiled, internal

# Number of begins on each side of that of a piece with which it is compared.
REACH = 10


class Segments(NamedTuple):
    """What the K segments of a track are made of. Further rows are no part of the track: in
    `PieceSmoother.compare` the same segments as they begin gradually.
    """

    # (T,) number of the segment of each tick.
    places: IntArray
    # (T,) True where one begins.
    begins: BoolArray
    # (K,) 1 / radius of the mode, positive to the left; 0 of others.
    curvatures: FloatArray
    # (K,) acceleration along the heading at the begin; NaN of straight motion and turns.
    accelerations: FloatArray
    # (K,) True if the object stands: that it has no velocity is then measured.
    stands: BoolArray
    # (K, 6, 6) by which the first six states move in a tick, its derivative by the turn rate, what
    # is added, and the covariance of the noise.
    F: FloatArray
    slopes: FloatArray
    B: FloatArray
    Q: FloatArray
    # (K,) turn rate at which the motion is linearised.
    rates: FloatArray
    # Relative deviation of the curvature of a turn from that of its segment.
    spread: float


class FilterMemory(NamedTuple):
    """What the filter remembers of the n ticks of a block."""

    # (n + 1, 7) and (n + 1, 7, 7), of which the first rows are those before the block.
    states: FloatArray
    covariances: FloatArray
    # (n, 7, 7) of the state by that of the tick before.
    steps: FloatArray
    # (n, 7, m) of m measured coordinates.
    gains: FloatArray
    # (n, m) innovations, and (n, m, m) the inverses of their covariances, 0 without a measurement.
    errors: FloatArray
    inverses: FloatArray


@internal
def _times(left: FloatArray, right: FloatArray) -> FloatArray:
    """Return the product of a matrix (n, m) and a matrix (m, 7). Products of so few numbers take
    less time than calls of a library for matrices.
    """
    product = np.zeros((left.shape[0], STATES))
    for i in range(left.shape[0]):
        for k in range(left.shape[1]):
            for j in range(STATES):
                product[i, j] += left[i, k] * right[k, j]
    return product


@internal
def _applied(A: FloatArray, x: FloatArray) -> FloatArray:
    """Return the product of a matrix and a vector, see `_times`."""
    product = np.empty(A.shape[0])
    for i in range(A.shape[0]):
        total = 0.0
        for k in range(A.shape[1]):
            total += A[i, k] * x[k]
        product[i] = total
    return product


@internal
def _carried(A: FloatArray, P: FloatArray) -> FloatArray:
    """Return A P A' of matrices of the state, P symmetric."""
    carried = np.empty((STATES, STATES))
    row = np.empty(STATES)
    for i in range(STATES):
        row[:] = 0.0
        for k in range(STATES):
            if A[i, k] != 0.0:
                for j in range(STATES):
                    row[j] += A[i, k] * P[k, j]
        for j in range(i, STATES):
            total = 0.0
            for k in range(STATES):
                total += row[k] * A[j, k]
            carried[i, j] = carried[j, i] = total
    return carried


@internal
def _begin(
    x: FloatArray, P: FloatArray, place: int, segments: Segments, speed: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Begin a segment at the estimate of the one before.

    Args:
        x: (7,) state of the segment before, of which position and velocity count.
        P: (7, 7) its covariance.
        place: number of the segment.
        segments: of the track.
        speed: of a turn if the estimate does not tell it, as after a stop [m/s].

    Returns:
        State (7,), covariance (7, 7), and the matrix (7, 7) of the state by that before.
    """
    curvature, acceleration = segments.curvatures[place], segments.accelerations[place]
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
    spread = _carried(J, P)
    spread[6, 6] += (segments.spread * begun[6]) ** 2
    return begun, spread, J


@internal
def _predict(
    x: FloatArray, P: FloatArray, A: FloatArray, place: int, segments: Segments
) -> tuple[FloatArray, FloatArray]:
    """Return state and covariance after a tick of a segment, and write the matrix (7, 7) of the
    state by that before.
    """
    predicted = x.copy()
    for i in range(6):
        slope = 0.0
        for j in range(6):
            A[i, j] = segments.F[place, i, j]
            slope += segments.slopes[place, i, j] * x[j]
        A[i, 6] = slope
        predicted[i] = segments.B[place, i] + slope * (x[6] - segments.rates[place])
        for j in range(6):
            predicted[i] += A[i, j] * x[j]
    P = _carried(A, P)
    for i in range(6):
        for j in range(6):
            P[i, j] += segments.Q[place, i, j]
    return predicted, P


@internal
def _correct(
    x: FloatArray,
    P: FloatArray,
    measurement: FloatArray,
    noise: FloatArray,
    stands: bool,
    freedom: float,
    inverse: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, float]:
    """Return state and covariance after a measurement, the gain (7, m), the innovation (m,), and
    the log-likelihood without its constant; of Student's t errors that of a normal one with the
    noise that is used.

    Args:
        x: (7,) predicted state.
        P: (7, 7) its covariance.
        measurement: (m,) position, NaN if there is none [m], and if m is 4 velocity, likewise
            [m/s].
        noise: covariance xx, xy, yy of the position [m^2], and variance of a velocity [m^2/s^2].
        stands: whether the velocity is that of an object that stands.
        freedom: of Student's t errors; 0 is normal ones.
        inverse: (m, m) of the covariance of the innovation, 0 of what does not correct the state,
            written.
    """
    inverse[:] = 0.0
    error = np.zeros(len(measurement))
    gain = np.zeros((STATES, len(measurement)))
    if math.isnan(measurement[0]):
        return x, P, gain, error, 0.0
    told = len(measurement) > 2 and not math.isnan(measurement[-1])
    count = 4 if told and not stands else 2
    error[:count] = measurement[:count] - x[:count]
    weight = 1.0
    # To a robust likelihood the noise of a measurement that is far is larger.
    for _ in range(2 if freedom > 0.0 else 1):
        xx, xy, yy = noise[0] / weight, noise[1] / weight, noise[2] / weight
        if count == 2:
            a, b, c = P[0, 0] + xx, P[0, 1] + xy, P[1, 1] + yy
            determinant = a * c - b * b
            inverse[0, 0], inverse[1, 1] = c / determinant, a / determinant
            inverse[0, 1] = inverse[1, 0] = -b / determinant
        else:
            S = P[:4, :4].copy()
            S[0, 0], S[0, 1], S[1, 0], S[1, 1] = (
                S[0, 0] + xx,
                S[0, 1] + xy,
                S[1, 0] + xy,
                S[1, 1] + yy,
            )
            S[2, 2] += noise[-1] / weight
            S[3, 3] += noise[-1] / weight
            determinant = np.linalg.det(S)
            inverse[:] = np.linalg.inv(S)
        distance = 0.0
        for i in range(count):
            for j in range(count):
                distance += error[i] * inverse[i, j] * error[j]
        weight = min((freedom + count) / (freedom + distance), 1.0)
    corrected = x.copy()
    covariance = np.empty((STATES, STATES))
    for i in range(STATES):
        for j in range(count):
            for k in range(count):
                gain[i, j] += P[i, k] * inverse[k, j]
            corrected[i] += gain[i, j] * error[j]
        for j in range(i, STATES):
            left = P[i, j]
            for k in range(count):
                left -= gain[i, k] * P[k, j]
            # Rounding errors that are not symmetric would grow.
            covariance[i, j] = covariance[j, i] = left
    log_likelihood = -0.5 * (distance + math.log(determinant))
    if told and stands:
        square = measurement[2] ** 2 + measurement[3] ** 2
        log_likelihood -= 0.5 * square / noise[-1] + math.log(noise[-1])
    return corrected, covariance, gain, error, log_likelihood


@compiled
def filter_block(
    measurements: FloatArray,
    noises: FloatArray,
    first: int,
    segments: Segments,
    speed: float,
    freedom: float,
    memory: FilterMemory,
    known: int,
) -> None:
    """Filter the ticks of a block and fill its memory.

    Args:
        measurements: (T, m) up to the end of the block, see `PieceSmoother`.
        noises: (T, m / 2 + 2) likewise.
        first: number of the first tick of the block.
        segments: of the whole track.
        speed: as in `_begin`.
        freedom: of Student's t errors; 0 is normal ones.
        memory: its first rows have state and covariance before the block.
        known: number of first ticks that the memory has already.
    """
    x = memory.states[known].copy()
    P = memory.covariances[known].copy()
    A, J = np.eye(STATES), np.eye(STATES)
    for k in range(known, len(measurements) - first):
        place = segments.places[first + k]
        begins = segments.begins[first + k]
        if begins:
            x, P, J = _begin(x, P, place, segments, speed)
        x, P = _predict(x, P, A, place, segments)
        memory.steps[k] = A @ J if begins else A
        seen, noise = measurements[first + k], noises[first + k]
        stands, inverse = segments.stands[place], memory.inverses[k]
        x, P, gain, error, _ = _correct(x, P, seen, noise, stands, freedom, inverse)
        memory.gains[k] = gain
        memory.errors[k] = error
        memory.states[k + 1] = x
        memory.covariances[k + 1] = P


@compiled
def compare_begins(
    measurements: FloatArray,
    noises: FloatArray,
    pieces: IntArray,
    segments: Segments,
    speed: float,
    freedom: float,
    numbers: IntArray,
    firsts: IntArray,
    states: FloatArray,
    covariances: FloatArray,
    gradual: IntArray,
    stride: int,
    log_likelihoods: FloatArray,
) -> None:
    """Write how likely the measurements around the begins of n pieces are if these begin elsewhere,
    or gradually.

    Args:
        measurements: as in `filter_block`.
        noises: likewise.
        pieces: (K, 3) as in `PieceSmoother.smooth`.
        segments: of the pieces, and then the same as they begin gradually.
        speed: as in `_begin`.
        freedom: as in `filter_block`.
        numbers: (n,) of the pieces, not the first one.
        firsts: (n,) first of the begins that are compared.
        states: (n, 7) before these ticks.
        covariances: (n, 7, 7) of the states.
        gradual: (G,) ticks for which they do, the first 0.
        stride: ticks between two begins that are compared.
        log_likelihoods: see `PieceSmoother.compare`, written.
    """
    A = np.eye(STATES)
    inverse = np.empty((measurements.shape[1], measurements.shape[1]))
    count = len(pieces)
    for row in range(len(numbers)):
        k = numbers[row]
        begin, end = pieces[k, 0], pieces[k, 1]
        # All ways are the same where the curvature does not change.
        changes = segments.curvatures[k] != segments.curvatures[count + k]
        ways = len(gradual) if changes else 1
        x, P = states[row].copy(), covariances[row].copy()
        before = 0.0
        # The begin itself is always compared.
        last = min(begin + REACH * stride, end - 2)
        for now in range(firsts[row], max(last, begin) + 1, stride):
            for g in range(ways):
                log_likelihood = before
                y, V = x, P
                whole = now + gradual[g]
                for tick in range(now, min(end, begin + 3 * REACH * stride)):
                    place = k if tick >= whole else count + k
                    if tick in (now, whole):
                        y, V, _ = _begin(y, V, place, segments, speed)
                    y, V = _predict(y, V, A, place, segments)
                    seen, noise, stands = measurements[tick], noises[tick], segments.stands[place]
                    y, V, _, _, more = _correct(y, V, seen, noise, stands, freedom, inverse)
                    log_likelihood += more
                log_likelihoods[row, g:, (now - begin) // stride + REACH] = log_likelihood
            # The piece before goes on.
            for tick in range(now, now + stride):
                x, P = _predict(x, P, A, k - 1, segments)
                seen, noise, stands = measurements[tick], noises[tick], segments.stands[k - 1]
                x, P, _, _, more = _correct(x, P, seen, noise, stands, freedom, inverse)
                before += more


@compiled
def compare_modes(
    measurements: FloatArray,
    noises: FloatArray,
    pieces: IntArray,
    modes: Segments,
    speed: float,
    freedom: float,
    states: FloatArray,
    covariances: FloatArray,
    log_likelihoods: FloatArray,
) -> None:
    """Write how likely the measurements of some pieces are in each mode; the arguments are those of
    `compare_begins`, with the segments of all modes, and see `PieceSmoother.compare_modes`.
    """
    A = np.eye(STATES)
    inverse = np.empty((measurements.shape[1], measurements.shape[1]))
    for k in range(len(pieces)):
        for mode in range(log_likelihoods.shape[1]):
            x, P, _ = _begin(states[k], covariances[k], mode, modes, speed)
            for tick in range(pieces[k, 0], min(pieces[k, 1], pieces[k, 0] + 10 * REACH)):
                x, P = _predict(x, P, A, mode, modes)
                seen, noise, stands = measurements[tick], noises[tick], modes.stands[mode]
                x, P, _, _, more = _correct(x, P, seen, noise, stands, freedom, inverse)
                log_likelihoods[k, mode] += more


@internal
def _smoothed(
    memory: FilterMemory,
    k: int,
    adjoint: FloatArray,
    information: FloatArray,
    means: FloatArray,
    covariances: FloatArray,
) -> None:
    """Write state and covariance of tick k of a block, given its later ticks too."""
    P = memory.covariances[k + 1]
    means[k] = memory.states[k + 1] - _applied(P, adjoint)
    covariances[k] = P - _carried(P, information)


@internal
def _go_back(memory: FilterMemory, k: int, adjoint: FloatArray, information: FloatArray) -> None:
    """Bring what later ticks say to the begin of tick k of a block."""
    inverse = memory.inverses[k]
    step = memory.steps[k]
    seen = step[: len(inverse)]
    # The step, and what the correction by the measurement leaves of it.
    left = (step - _times(memory.gains[k], seen)).T.copy()
    weighted = _times(inverse, seen)
    adjoint[:] = _applied(left, adjoint) - _applied(weighted.T, memory.errors[k])
    information[:] = _carried(left, information) + _times(seen.T, weighted)


@compiled
def smooth_block(
    memory: FilterMemory,
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
        turns: (n, 4) see `turns.TurnEstimate`, written.
    """
    for k in range(len(means) - 1, -1, -1):
        _smoothed(memory, k, adjoint, information, means, covariances)
        values = turn_of(means[k], covariances[k])
        for j in range(4):
            turns[k, j] = values[j]
        _go_back(memory, k, adjoint, information)


@compiled
def smooth_first(
    measurements: FloatArray,
    noises: FloatArray,
    segments: Segments,
    speed: float,
    freedom: float,
    memory: FilterMemory,
    last: IntArray,
    means: FloatArray,
    covariances: FloatArray,
) -> None:
    """Smooth the first tick of a block; the arguments are those of `filter_block` and
    `smooth_block`.

    The memory is that of a block that began one tick earlier, whose ticks had the segments `last`.
    """
    known = 0
    while known < len(last) - 1 and last[known + 1] == segments.places[known]:
        known += 1
    for array in (memory.states, memory.errors):
        array[:-1] = array[1:].copy()
    for stack in (memory.covariances, memory.steps, memory.gains, memory.inverses):
        stack[:-1] = stack[1:].copy()
    filter_block(measurements, noises, 0, segments, speed, freedom, memory, known)
    adjoint, information = np.zeros(STATES), np.zeros((STATES, STATES))
    for k in range(len(measurements) - 1, 0, -1):
        _go_back(memory, k, adjoint, information)
    _smoothed(memory, 0, adjoint, information, means, covariances)
