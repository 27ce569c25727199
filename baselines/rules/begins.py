"""Where the pieces of a track begin: gradual turns, brakes, and how well a moment is known."""

import math

import numpy as np
from scipy.special import logsumexp, softmax

from baselines.estimation.piece_filter import REACH
from baselines.estimation.pieces import GRADUAL, PieceSmoother
from hybrid_env.checks import BoolArray, FloatArray, IntArray
from hybrid_env.quickest_options import QuickestOptions


def pieces_of(begins: IntArray, modes: IntArray, ticks: int) -> IntArray:
    """Return pieces (K, 3) from their begins and modes (K,) and the number of all ticks."""
    return np.stack([begins, np.append(begins[1:], ticks), modes], axis=1)


def modes_of(pieces: IntArray) -> IntArray:
    """Return the modes (T,) of pieces (K, 3)."""
    return np.repeat(pieces[:, 2], pieces[:, 1] - pieces[:, 0])


def runs_of(modes: IntArray) -> IntArray:
    """Return pieces (K, 3) of modes (T,)."""
    begins = np.flatnonzero(np.diff(modes, prepend=-1))
    return pieces_of(begins, modes[begins], len(modes))


def find_begins(
    pieces: IntArray,
    measured: BoolArray,
    options: QuickestOptions,
    smoother: PieceSmoother,
    process_share: float,
) -> tuple[IntArray, IntArray, IntArray]:
    """Return the begins of pieces (K,), the intervals that hold them with a probability of .95,
    (K, 2), and the ticks (K,) for which they begin gradually.

    Most turns begin in one way, abruptly or with the mean of two curvatures for some ticks, and
    most end in one way. If a gradual way is the most probable one, pieces begin where they most
    likely do; else all begins remain. They also remain if innovations are larger than four, or if
    for more than a quarter of the pieces the likelihood of an abrupt begin is largest at the
    edge of what is compared: the model then describes begins badly.

    Args:
        pieces: (K, 3) as of `SmoothedModes`, K > 1.
        measured: (T,) whether there is a measurement.
        options: with the modes.
        smoother: of the pieces.
        process_share: as of `smooth_modes`.
    """
    motions = options.motions[pieces[:, 2]]
    linear = motions["linear"]
    times = GRADUAL
    turns = (np.diff(motions["signed_radius"]) != 0.0) & ~linear[1:] & ~linear[:-1]
    numbers = np.arange(len(turns))
    # Innovations along its pieces by which a recording says little of begins, see `PieceSmoother`.
    largest = 4.0
    # So many pieces tell the ways of all.
    some = np.linspace(0, len(turns) - 1, min(len(turns), 200)).astype(int)
    # Ticks between two begins that are compared, until most pieces have the likeliest among them.
    for stride in (1, 2, 4):
        compared, misfit = smoother.compare(some + 1, GRADUAL, stride, process_share)
        padded = np.pad(compared[:, 0], ((0, 0), (1, 1)), constant_values=-np.inf)
        each, peaks = np.arange(len(some)), compared[:, 0].argmax(1)
        inside = np.isfinite(padded[each, peaks]) & np.isfinite(padded[each, peaks + 2])
        if misfit > largest or inside.mean() >= 0.75:
            break
    abrupt = np.eye(len(GRADUAL))[0]
    shares = np.tile(abrupt, (len(turns), 1))
    for into_turns in (True, False):
        group = turns & ((motions["signed_radius"][1:] != 0.0) == into_turns)
        if misfit <= largest and inside.mean() >= 0.75 and group[some].any():
            shares[group] = _ways_of(logsumexp(compared[group[some] & inside], axis=2))
    if len(some) < len(turns):
        # Of all pieces only the ways that count, and the abrupt one.
        counts = abrupt + shares.max(0) > 0.01
        shares, times = shares[:, counts], GRADUAL[counts]
        shares /= shares.sum(1, keepdims=True)
        compared, _ = smoother.compare(numbers + 1, times, stride, process_share)
    of_shifts = softmax(compared, axis=2)
    begins, moments = pieces[:, 0].copy(), pieces[:, [0, 0]]
    gradual = np.zeros(len(pieces), int)
    ways = shares.argmax(1)
    if ways.any():
        # No piece keeps less than three rows. Stops and other linear modes begin as decided.
        shifts = stride * np.arange(-REACH, REACH + 1)
        rows = np.add.reduceat(measured.astype(int), pieces[:, 0])
        most = np.maximum(rows - 3, 0)[:, None] // 2
        usual = 0.5 * stride * times[ways][:, None]
        allowed = (shifts >= -most[:-1]) & (shifts <= most[1:])
        allowed &= np.abs(shifts + usual) <= usual + 2.0 * stride
        best = np.where(allowed, of_shifts[numbers, ways], -1.0).argmax(1)
        begins[1:] += np.where(linear[1:], 0, stride * (best - REACH))
        gradual[1:] = stride * times[ways]
    sums = np.cumsum((shares[:, :, None] * of_shifts).sum(1), axis=1)
    for column, probability in enumerate((0.025, 0.975)):
        moments[1:, column] += stride * ((sums < probability).sum(1) - REACH)
    moments[:, 0] = np.minimum(moments[:, 0], begins)
    moments[:, 1] = np.maximum(moments[:, 1], begins)
    return begins, moments, gradual


def is_passed(pieces: IntArray, gradual: IntArray, options: QuickestOptions) -> BoolArray:
    """Return whether each piece (K,) is straight motion that the object only passes from a turn to
    one to the other side, in the ticks for which turns begin gradually.

    Args:
        pieces: (K, 3) as of `SmoothedModes`.
        gradual: (K,) these ticks.
        options: with the modes.
    """
    motions = options.motions[pieces[:, 2]]
    sides = np.sign(motions["signed_radius"])
    straight = (sides == 0.0) & ~motions["linear"]
    passed = np.zeros(len(pieces), bool)
    passed[1:-1] = straight[1:-1] & (sides[:-2] * sides[2:] < 0.0)
    return passed & (pieces[:, 1] - pieces[:, 0] <= gradual.max(initial=0))


def _ways_of(log_likelihoods: FloatArray) -> FloatArray:
    """Return the probabilities (G,) of the ways in which most of some pieces begin.

    Args:
        log_likelihoods: (n, G) of each piece.
    """
    ways = len(GRADUAL)
    # Of an abrupt begin, which no single piece outweighs; and of a piece that begins in another way
    # than most.
    abrupt, otherwise = 0.94, 0.1
    prior = np.full(ways, (1.0 - abrupt) / (ways - 1))
    prior[0] = abrupt
    other = logsumexp(log_likelihoods, axis=1, keepdims=True) - math.log(ways)
    of_pieces = np.logaddexp(
        math.log(1.0 - otherwise) + log_likelihoods, math.log(otherwise) + other
    )
    return softmax(np.log(prior) + of_pieces.sum(0))


def find_brakes(
    pieces: IntArray, stands: BoolArray, speeds: FloatArray, short: float
) -> tuple[IntArray, BoolArray]:
    """Return the begins of pieces (K,), those of stops where the object begins to brake, and which
    pieces (K,) remain.

    From this begin on it is slower than in half of the piece before, by a tenth and by two standard
    deviations. A short piece in which it is slower throughout is part of the stop.

    Args:
        pieces: (K, 3) as of `SmoothedModes`.
        stands: (M,) whether a mode is a stop.
        speeds: (T, 2) and their deviations.
        short: ticks of the longest short piece.
    """
    begins, kept = pieces[:, 0].copy(), np.ones(len(pieces), bool)
    standing = stands[pieces[:, 2]]
    for k in np.flatnonzero(standing[1:]) + 1:
        for j in range(k - 1, -1, -1):
            begin, end = pieces[j, :2]
            if standing[j]:
                break
            speed, deviation = speeds[begin : pieces[k, 0]].T
            usual = np.median(speed[: end - begin])
            fast = np.flatnonzero((speed > 0.9 * usual) | (speed + 2.0 * deviation > usual))
            last = begin + max(fast[-1] + 1, 3)
            begins[k] = min(last, begins[k])
            kept[j + 1 : k] &= pieces[j + 1 : k, 0] < begins[k]
            if last < end or end - begin > short:
                break
    return begins, kept
