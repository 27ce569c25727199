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
from typing import Any, NamedTuple

import numpy as np

from baselines.estimation.turns import STATES, turn_of
from hybrid_env.checks import AnyArray, BoolArray, FloatArray, IntArray
from hybrid_env.compiled import compiled, internal

# Number of begins on each side of that of a piece with which it is compared.
REACH = 10


# A segment of a track: 1 / radius of its mode, positive to the left, 0 of others; acceleration
# along the heading at the begin, NaN of straight motion and turns; True if the object stands: that
# it has no velocity is then measured; by which the first six states move in a tick, its derivative
# by the turn rate, what is added, and the covariance of the noise; turn rate at which the motion is
# linearised.
SEGMENT = np.dtype(
    [
        ("curvature", float),
        ("acceleration", float),
        ("stands", bool),
        ("F", float, (6, 6)),
        ("slopes", float, (6, 6)),
        ("B", float, (6,)),
        ("Q", float, (6, 6)),
        ("rate", float),
    ],
    align=True,
)
# What the filter remembers of a tick: state and covariance after it; the state by that of the tick
# before; the gain of the measured coordinates, at most four, their innovations, and the inverse of
# the covariance of these, 0 without a measurement.
TICK = np.dtype(
    [
        ("state", float, (STATES,)),
        ("covariance", float, (STATES, STATES)),
        ("step", float, (STATES, STATES)),
        ("gain", float, (STATES, 4)),
        ("error", float, (4,)),
        ("inverse", float, (4, 4)),
    ]
)


class Measured(NamedTuple):
    """What is measured at T ticks."""

    # (T, m) positions [m], NaN if there is none, and if m is 4 velocities, likewise [m/s].
    measurements: FloatArray
    # (T, m / 2 + 2) covariances xx, xy, yy of the positions [m^2], and variances of a velocity
    # [m^2/s^2].
    noises: FloatArray


class FilterMemory(NamedTuple):
    """Memory of the filter."""

    # (n + 1,) records `TICK` of the n ticks of a block, of which the first one is before it.
    ticks: AnyArray
    # (1,) record of products at a tick: arrays that are made anew take longer.
    scratch: AnyArray


def filter_memory(ticks: int) -> FilterMemory:
    """Return memory for blocks of so many ticks."""
    square = STATES, STATES
    scratch = [
        ("product", float, square),
        ("left", float, square),
        ("rows", float, (4, STATES)),
        ("state", float, (STATES,)),
    ]
    return FilterMemory(np.zeros(ticks + 1, TICK), np.zeros(1, scratch))


class Segments(NamedTuple):
    """What the K segments of a track are made of. Further rows are no part of the track: in
    `PieceSmoother.compare` the same segments as they begin gradually.
    """

    # (T,) number of the segment of each tick.
    places: IntArray
    # (T,) True where one begins.
    begins: BoolArray
    # (K,) records `SEGMENT`
    records: AnyArray
    # Relative deviation of the curvature of a turn from that of its segment.
    spread: float


@internal
def _carry(A: FloatArray, P: FloatArray, scratch: Any) -> None:
    """Replace a symmetric matrix P of the state by A P A'. Products of so few numbers take less
    time than calls of a library for matrices. scratch: record of `FilterMemory`
    """
    product = scratch.product
    for i in range(STATES):
        for j in range(STATES):
            product[i, j] = 0.0
        for k in range(STATES):
            if A[i, k] != 0.0:
                for j in range(STATES):
                    product[i, j] += A[i, k] * P[k, j]
    for j in range(STATES):
        for i in range(j + 1):
            P[i, j] = 0.0
        for k in range(STATES):
            if A[j, k] != 0.0:
                for i in range(j + 1):
                    P[i, j] += product[i, k] * A[j, k]
        for i in range(j):
            P[j, i] = P[i, j]


@internal
def _begin(now: Any, segment: Any, spread: float, speed: float, scratch: Any) -> FloatArray:
    """Begin a segment at the estimate of the one before, and return the matrix (7, 7) of the state
    by that before.

    Args:
        now: record `TICK` with the state of the segment before, of which position and velocity
            count, and its covariance; changed.
        segment: record `SEGMENT`
        spread: as of `Segments`.
        speed: of a turn if the estimate does not tell it, as after a stop [m/s].
        scratch: record of `FilterMemory`
    """
    x, P = now.state, now.covariance
    J = np.zeros((STATES, STATES))
    J[:4, :4] = np.eye(4)
    known = math.hypot(x[2], x[3])
    along = x[2:4] / max(known, 1e-300)
    x[6] = 0.0
    if math.isnan(segment.acceleration):
        x[4:6] = x[2:4]
        J[4:6, 2:4] = np.eye(2)
        if P[2, 2] + P[3, 3] < known**2:
            x[6] = segment.curvature * known
            J[6, 2:4] = segment.curvature * along
        else:
            x[6] = segment.curvature * speed
    else:
        # Bounded as in `anchor_aware.begin_motion`.
        slope = segment.acceleration / max(known, math.sqrt(P[2, 2] + P[3, 3]), 1e-12)
        x[4:6] = segment.acceleration * along
        J[4:6, 2:4] = slope * (np.eye(2) - np.outer(along, along))
    _carry(J, P, scratch)
    P[6, 6] += (spread * x[6]) ** 2
    return J


@internal
def _predict(now: Any, segment: Any, scratch: Any) -> None:
    """Advance state and covariance by a tick of a segment, and write the step; arguments as of
    `_begin`.
    """
    x, A, predicted = now.state, now.step, scratch.state
    for i in range(6):
        slope = 0.0
        for j in range(6):
            A[i, j] = segment.F[i, j]
            slope += segment.slopes[i, j] * x[j]
        A[i, 6] = slope
        A[6, i] = 0.0
        predicted[i] = segment.B[i] + slope * (x[6] - segment.rate)
        for j in range(6):
            predicted[i] += A[i, j] * x[j]
    A[6, 6] = 1.0
    for i in range(6):
        x[i] = predicted[i]
    _carry(A, now.covariance, scratch)
    for i in range(6):
        for j in range(6):
            now.covariance[i, j] += segment.Q[i, j]


@internal
def _correct(
    now: Any, segment: Any, tick: int, measured: Measured, freedom: float, scratch: Any
) -> float:
    """Correct a predicted state and its covariance by the measurement of a tick; write the gain,
    the innovation, and the inverse of its covariance. Return the log-likelihood without its
    constant; of Student's t errors that of a normal one with the noise that is used.

    Args:
        now: as of `_begin`.
        segment: likewise.
        tick: number of the tick.
        measured: see `Measured`.
        freedom: of Student's t errors; 0 is normal ones.
        scratch: as of `_begin`.
    """
    measurements, noises = measured
    x, P, rows = now.state, now.covariance, scratch.rows
    gain, error, inverse = now.gain, now.error, now.inverse
    gain[:] = 0.0
    error[:] = 0.0
    inverse[:] = 0.0
    if math.isnan(measurements[tick, 0]):
        return 0.0
    told = measurements.shape[1] > 2 and not math.isnan(measurements[tick, -1])
    count = 4 if told and not segment.stands else 2
    for k in range(count):
        error[k] = measurements[tick, k] - x[k]
        for j in range(STATES):
            rows[k, j] = P[k, j]
    variance = noises[tick, -1]
    weight = 1.0
    # To a robust likelihood the noise of a measurement that is far is larger.
    for _ in range(2 if freedom > 0.0 else 1):
        xx, xy, yy = noises[tick, 0] / weight, noises[tick, 1] / weight, noises[tick, 2] / weight
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
            S[2, 2] += variance / weight
            S[3, 3] += variance / weight
            determinant = np.linalg.det(S)
            inverse[:] = np.linalg.inv(S)
        distance = 0.0
        for i in range(count):
            for j in range(count):
                distance += error[i] * inverse[i, j] * error[j]
        weight = min((freedom + count) / (freedom + distance), 1.0)
    for i in range(STATES):
        for j in range(count):
            for k in range(count):
                gain[i, j] += rows[k, i] * inverse[k, j]
            x[i] += gain[i, j] * error[j]
        for j in range(i, STATES):
            left = P[i, j]
            for k in range(count):
                left -= gain[i, k] * rows[k, j]
            # Rounding errors that are not symmetric would grow.
            P[i, j] = P[j, i] = left
    log_likelihood = -0.5 * (distance + math.log(determinant))
    if told and segment.stands:
        square = measurements[tick, 2] ** 2 + measurements[tick, 3] ** 2
        log_likelihood -= 0.5 * square / variance + math.log(variance)
    return log_likelihood


@internal
def _copy_estimate(source: Any, target: Any) -> None:
    """Copy state and covariance of a record `TICK` to another one."""
    for i in range(STATES):
        target.state[i] = source.state[i]
        for j in range(STATES):
            target.covariance[i, j] = source.covariance[i, j]


@compiled
def filter_block(
    measured: Measured,
    first: int,
    end: int,
    segments: Segments,
    speed: float,
    freedom: float,
    memory: FilterMemory,
    known: int,
) -> None:
    """Filter the ticks of a block and fill its memory.

    Args:
        measured: of the whole track.
        first: number of the first tick of the block.
        end: that after its last one.
        segments: of the whole track.
        speed: as in `_begin`.
        freedom: of Student's t errors; 0 is normal ones.
        memory: of the block.
        known: number of first ticks that the memory has already.
    """
    scratch = memory.scratch[0]
    for k in range(known, end - first):
        now, tick = memory.ticks[k + 1], first + k
        segment = segments.records[segments.places[tick]]
        _copy_estimate(memory.ticks[k], now)
        if segments.begins[tick]:
            J = _begin(now, segment, segments.spread, speed, scratch)
            _predict(now, segment, scratch)
            now.step[:] = now.step @ J
        else:
            _predict(now, segment, scratch)
        _correct(now, segment, tick, measured, freedom, scratch)


@compiled
def compare_begins(
    measured: Measured,
    pieces: IntArray,
    segments: Segments,
    speed: float,
    freedom: float,
    memory: FilterMemory,
    numbers: IntArray,
    firsts: IntArray,
    before: AnyArray,
    gradual: IntArray,
    stride: int,
    log_likelihoods: FloatArray,
) -> None:
    """Write how likely the measurements around the begins of n pieces are if these begin elsewhere,
    or gradually.

    Args:
        measured: as in `filter_block`.
        pieces: (K, 3) as in `PieceSmoother.settle`.
        segments: of the pieces, and then the same as they begin gradually.
        speed: as in `_begin`.
        freedom: as in `filter_block`.
        memory: its first tick is overwritten.
        numbers: (n,) of the pieces, not the first one.
        firsts: (n,) first of the begins that are compared.
        before: (n,) records `TICK` before these ticks, changed.
        gradual: (G,) ticks for which they do, the first 0.
        stride: ticks between two begins that are compared.
        log_likelihoods: see `PieceSmoother.compare`, written.
    """
    scratch, other = memory.scratch[0], memory.ticks[0]
    records, spread = segments.records, segments.spread
    count = len(pieces)
    for row in range(len(numbers)):
        k = numbers[row]
        begin, end = pieces[k, 0], pieces[k, 1]
        # All ways are the same where the curvature does not change.
        changes = records[k].curvature != records[count + k].curvature
        ways = len(gradual) if changes else 1
        now = before[row]
        sooner = 0.0
        # The begin itself is always compared.
        last = min(begin + REACH * stride, end - 2)
        for moment in range(firsts[row], max(last, begin) + 1, stride):
            for g in range(ways):
                log_likelihood = sooner
                _copy_estimate(now, other)
                whole = moment + gradual[g]
                for tick in range(moment, min(end, begin + 3 * REACH * stride)):
                    segment = records[k if tick >= whole else count + k]
                    if tick in (moment, whole):
                        _begin(other, segment, spread, speed, scratch)
                    _predict(other, segment, scratch)
                    log_likelihood += _correct(other, segment, tick, measured, freedom, scratch)
                log_likelihoods[row, g:, (moment - begin) // stride + REACH] = log_likelihood
            # The piece before goes on.
            for tick in range(moment, min(moment + stride, end)):
                _predict(now, records[k - 1], scratch)
                sooner += _correct(now, records[k - 1], tick, measured, freedom, scratch)


@compiled
def compare_modes(
    measured: Measured,
    pieces: IntArray,
    modes: Segments,
    speed: float,
    freedom: float,
    memory: FilterMemory,
    before: AnyArray,
    log_likelihoods: FloatArray,
) -> None:
    """Write how likely the measurements of some pieces are in each mode; the arguments are those of
    `compare_begins`, with the segments of all modes, and see `PieceSmoother.compare_modes`.
    """
    scratch, now = memory.scratch[0], memory.ticks[0]
    for k in range(len(pieces)):
        for mode in range(log_likelihoods.shape[1]):
            segment = modes.records[mode]
            _copy_estimate(before[k], now)
            _begin(now, segment, modes.spread, speed, scratch)
            for tick in range(pieces[k, 0], min(pieces[k, 1], pieces[k, 0] + 10 * REACH)):
                _predict(now, segment, scratch)
                log_likelihoods[k, mode] += _correct(now, segment, tick, measured, freedom, scratch)


@internal
def _write_mean(now: Any, adjoint: FloatArray, mean: FloatArray) -> None:
    """Write the state (7,) of a tick, a record `TICK`, given later ones too; adjoint: (7,) of
    these.
    """
    for i in range(STATES):
        mean[i] = now.state[i]
        for j in range(STATES):
            mean[i] -= now.covariance[i, j] * adjoint[j]


@internal
def _write_covariance(
    now: Any, information: FloatArray, covariance: FloatArray, scratch: Any
) -> None:
    """Write the covariance (7, 7) of the state that `_write_mean` writes; information: (7, 7) of
    later ticks.
    """
    covariance[:] = information
    _carry(now.covariance, covariance, scratch)
    for i in range(STATES):
        for j in range(STATES):
            covariance[i, j] = now.covariance[i, j] - covariance[i, j]


@internal
def _go_back(now: Any, adjoint: FloatArray, information: FloatArray, m: int, scratch: Any) -> None:
    """Bring what later ticks say to the begin of a tick, a record `TICK`, with m measured
    coordinates.
    """
    step, gain = now.step, now.gain
    left, weighted, new = scratch.left, scratch.rows, scratch.state
    for j in range(STATES):
        new[j] = 0.0
        for n in range(m):
            weighted[n, j] = 0.0
            for other in range(m):
                weighted[n, j] += now.inverse[n, other] * step[other, j]
            new[j] -= weighted[n, j] * now.error[n]
        # The step, and what the correction by the measurement leaves of it.
        for i in range(STATES):
            left[j, i] = step[i, j]
            for n in range(m):
                left[j, i] -= gain[i, n] * step[n, j]
            new[j] += left[j, i] * adjoint[i]
    for j in range(STATES):
        adjoint[j] = new[j]
    if len(information) > 0:
        _carry(left, information, scratch)
        for n in range(m):
            for i in range(STATES):
                for j in range(STATES):
                    information[i, j] += step[n, i] * weighted[n, j]


@compiled
def smooth_block(
    memory: FilterMemory,
    adjoint: FloatArray,
    information: FloatArray,
    m: int,
    means: FloatArray,
    covariances: FloatArray,
    turns: FloatArray,
) -> None:
    """Smooth a block that was filtered.

    Args:
        memory: of the block.
        adjoint: (7,) of the later blocks; it is brought to the begin of this one.
        information: (7, 7) likewise; (0, 7) if only means are written.
        m: number of measured coordinates.
        means: (n, 7) smoothed states, written.
        covariances: (n, 7, 7) their covariances, written.
        turns: (n, 4) see `turns.TurnEstimate`, written; (0, 4) likewise.
    """
    scratch = memory.scratch[0]
    for k in range(len(means) - 1, -1, -1):
        now = memory.ticks[k + 1]
        _write_mean(now, adjoint, means[k])
        if len(information) > 0:
            _write_covariance(now, information, covariances[k], scratch)
            values = turn_of(means[k], covariances[k])
            for j in range(4):
                turns[k, j] = values[j]
        _go_back(now, adjoint, information, m, scratch)


@compiled
def smooth_first(
    measured: Measured,
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
    ticks, m = measured.measurements.shape
    known = 0
    while known < len(last) - 1 and last[known + 1] == segments.places[known]:
        known += 1
    for k in range(ticks):
        memory.ticks[k] = memory.ticks[k + 1]
    filter_block(measured, 0, ticks, segments, speed, freedom, memory, known)
    adjoint, information = np.zeros(STATES), np.zeros((STATES, STATES))
    scratch = memory.scratch[0]
    for k in range(ticks, 1, -1):
        _go_back(memory.ticks[k], adjoint, information, m, scratch)
    _write_mean(memory.ticks[1], adjoint, means[0])
    _write_covariance(memory.ticks[1], information, covariances[0], scratch)
