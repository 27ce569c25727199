"""Modes and estimates of a whole recording, each from all of its measurements."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from baselines.estimation.pieces import PieceSmoother
from baselines.rules.beam import BeamDecider
from baselines.rules.beam_filters import BY_LAW, DEPTH, BeamModel
from baselines.rules.begins import find_begins, find_brakes, is_passed, modes_of, pieces_of, runs_of
from baselines.rules.lattice import smooth_lattice, walk_lattice
from baselines.rules.steady import worth_of
from hybrid_env.checks import (
    BoolArray,
    FloatArray,
    IntArray,
    Moments,
    check_array,
    check_covariance,
    check_integer,
    reject,
)
from hybrid_env.compiled import compiled, run_compiled
from hybrid_env.live import TRIANGLE
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.sensors import velocity_variance_of

# Share of the process noise of a recording, found or given, by which modes are decided: a noise
# that was found also covers brakes, and turns that begin gradually. It was chosen for simulated
# objects with both.
PROCESS_SHARE = 0.3


class SmoothedModes(NamedTuple):
    """What T measurements say about M modes, K pieces of one mode, and the object.

    Attributes:
        modes: (T,) those with the largest expected number of right rows, less 2 for each change. If
            one of them is a stop, it is also that of rows whose smoothed speed is below .3 of the
            usual one. Where turns begin or end gradually, and before stops, begins are then moved,
            see `begins`.
        probabilities: (T, M) of the modes.
        pieces: (K, 3) first tick, end and mode of the pieces.
        moments: (K, 2) first and last tick of the interval that holds the begin of a piece with a
            probability of .95, at most ten ticks from the begin that was decided first.
        estimates: (T, 4) [x, vx, y, vy] along the modes.
        covariances: (T, 4, 4) of the estimates.
        turns: (T, 4) speed and radius with their deviations, see `Turn`.
        log_likelihood: of the measurements.
    """

    modes: IntArray
    probabilities: FloatArray
    pieces: IntArray
    moments: IntArray
    estimates: FloatArray
    covariances: FloatArray
    turns: FloatArray
    log_likelihood: float


def smooth_modes(
    measurements: ArrayLike,
    options: QuickestOptions,
    start: Moments | None = None,
    switches: Sequence[int] | None = None,
    branches: int | None = None,
    process_share: float = 1.0,
) -> SmoothedModes:
    """Decide the modes of a whole recording at uniform ticks, and smooth its estimates.

    Args:
        measurements: (T, 2) positions [m], NaN where there is none. With sensors (T, 9): position,
            its covariance xx, xy, yy over R, and range rates and velocities, see
            `hybrid_env.sensors.Fused`.
        options: of the environment whose model is assumed: modes, noises, durations, transitions,
            and as `likelihood` normal errors or Student's t. The speed is roughly its own.
        start: estimate (4,) [x, vx, y, vy] and covariance (4, 4) one tick before the first
            measurement; None if nothing is known.
        switches: ticks at which the mode may change, to any mode with the same probability; None
            if they are not known.
        branches: largest number of segments that are followed at a tick; None is 8 for each mode,
            at least 64, in short recordings up to 4,096, whose histories are then told apart by
            four segments.
        process_share: share of the process noise by which modes are decided. Below 1 if it also
            covers motion that no mode has, such as brakes, and so hides where a turn begins.

    >>> from hybrid_env import simulate
    >>> seen = simulate("S60 L60r5", seed=1, measurement_variance=0.01).measurements[0]
    >>> result = smooth_modes(seen, QuickestOptions(measurement_variance=0.01))
    >>> result.pieces[:, 2].tolist(), abs(result.pieces[1, 0] - 60) < 5
    ([0, 1], True)
    """
    values = np.asarray(measurements, float)
    columns = 9 if options.sensors and values.shape[1:] == (9,) else 2
    values = check_array("measurements", values, (None, columns), missing=True)
    measured = ~np.isnan(values[:, 0])
    if not (measured[:1].all() and measured.any()) and start is None:
        raise reject("measurements", "no position in the first row", "one, or a start")
    R = options.variances
    noises = np.tile([R[0], 0.0, R[-1]], (len(values), 1))
    if columns == 9:
        noises[measured] = R[0] * values[measured, 2:5]
    model = beam_of(options, branches, process_share)
    ends = np.full(len(values), BY_LAW)
    if switches is not None:
        ticks = [check_integer("switches", k, 0, len(values) - 1) for k in switches]
        borders = np.unique([0, *ticks])
        ends[:] = 0.0
        ends[borders] = 1.0
        model = model._replace(order=np.full_like(model.order, 1.0 / options.hypotheses))
    # The first segment begins with the first measurement.
    ends[0] = 0.0
    if start is not None:
        start = check_array("start", start[0], (4,)), check_array("start", start[1], (4, 4))
        check_covariance("start", start[1], definite=False)
    starts, rough = starts_of(start, values[0, :2], noises[0], options)
    # Segments that are followed over all ticks of a recording whose histories are told apart by
    # more than the present segment, at most 4,096 at a tick.
    segments = 60_000
    if branches is None and model.branches * len(values) <= segments:
        most = max(model.branches, min(4_096, segments // len(values)))
        model = model._replace(depth=DEPTH, branches=most)
    lattice = walk_lattice(values, starts, ends, model)
    probabilities, log_likelihood = smooth_lattice(lattice, model), lattice.evidence
    # It is larger than all else of a long recording.
    del lattice
    smoother = smoother_of(options, *with_velocities(options, values, noises), rough)
    if switches is None:
        arguments = probabilities, measured, options, smoother, process_share
        pieces, moments, smoothed = _find_pieces(*arguments)
    else:
        decided = np.add.reduceat(probabilities, borders).argmax(1)
        pieces = pieces_of(borders, decided, len(values))
        smoother.settle(pieces)
        moments, smoothed = pieces[:, [0, 0]], smoother.smooth()
        smoothed[2][stops_of(options)[modes_of(pieces)], :2] = 0.0
    modes = modes_of(pieces)
    return SmoothedModes(modes, probabilities, pieces, moments, *smoothed, log_likelihood)


def stops_of(options: QuickestOptions) -> BoolArray:
    """Return whether each mode (M,) is a stop."""
    return np.array([mode.type == "stop" for mode in options.all_modes])


def _find_pieces(
    probabilities: FloatArray,
    measured: BoolArray,
    options: QuickestOptions,
    smoother: PieceSmoother,
    process_share: float,
) -> tuple[IntArray, IntArray, tuple[FloatArray, FloatArray, FloatArray]]:
    """Return pieces and moments, as of `SmoothedModes`, with the estimates, covariances and turns
    of a recording whose switches are not known.

    Args:
        probabilities: (T, M) of the modes.
        measured: (T,) whether there is a measurement.
        options: as of `smooth_modes`.
        smoother: of the measurements.
        process_share: as of `smooth_modes`.
    """
    ticks, weights = len(measured), measured.astype(float)
    worth = probabilities @ worth_of(options.types)
    pieces = runs_of(choose_modes(worth, weights))
    stands = stops_of(options)
    speeds = smoother.settle(pieces)
    if stands.any():
        speeds[stands[modes_of(pieces)]] = 0.0
        # Below this share of its usual speed it stands, also while it brakes.
        worth[speeds < 0.3 * options.speed] = stands
        pieces = runs_of(choose_modes(worth, weights))
        # The beam does not tell turns from each other that begin in an unknown direction.
        linear = options.motions["linear"]
        after = np.flatnonzero(stands[pieces[:-1, 2]] & ~linear[pieces[1:, 2]]) + 1
        compared = np.where(linear, -np.inf, smoother.compare_modes(pieces, after))
        pieces[after, 2] = compared.argmax(1)
        pieces = runs_of(modes_of(pieces))
    # Again, because turns are linearised at the turn rates found before.
    smoother.settle(pieces)
    moments = pieces[:, [0, 0]]
    if len(pieces) > 1:
        begins, moments, gradual = find_begins(pieces, measured, options, smoother, process_share)
        kept = ~is_passed(pieces_of(begins, pieces[:, 2], ticks), gradual, options)
        if not kept.all():
            begins = pieces[:, 0][kept]
            begins[1:] = np.where(kept[:-1][kept[1:]], begins[1:], pieces[:-1, 0][kept[1:]])
            pieces = pieces_of(begins, pieces[kept, 2], ticks)
            smoother.settle(pieces)
            arguments = pieces, measured, options, smoother, process_share
            begins, moments, gradual = find_begins(*arguments)
        if gradual.any() or (begins != pieces[:, 0]).any():
            pieces = pieces_of(begins, pieces[:, 2], ticks)
            smoother.settle(pieces, gradual)
    smoothed = smoother.smooth()
    # An object that stands has no speed, also where its position drifts.
    smoothed[2][stands[modes_of(pieces)], :2] = 0.0
    if stands.any():
        # Ticks of a piece that may be part of a stop.
        short = 0.2 * options.law.mean_duration
        begins, kept = find_brakes(pieces, stands, smoothed[2][:, :2], short)
        begins, moments = begins[kept], moments[kept]
        pieces = pieces_of(begins, pieces[kept, 2], ticks)
        moments[:, 0] = np.minimum(moments[:, 0], begins)
    return pieces, moments, smoothed


def beam_of(options: QuickestOptions, branches: int | None, process_share: float) -> BeamModel:
    """Return the model of the beam; the arguments are those of `smooth_modes`."""
    process_variance = process_share * options.process_variance
    if branches is None:
        branches = max(64, 8 * options.hypotheses)
    options = replace(options, process_variance=process_variance)
    return BeamDecider(options, branches=branches).model


def with_velocities(
    options: QuickestOptions, rows: FloatArray, noises: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return what a `PieceSmoother` reads of rows, see `smooth_modes`: their positions, and the
    velocities if the only sensor measures them, with their noises; range rates are not used.
    """
    variance = velocity_variance_of(options.sensors)
    if variance is not None and rows.shape[1] > 2:
        return rows[:, [0, 1, 5, 6]], np.insert(noises, 3, variance, axis=1)
    return rows[:, :2].copy(), noises


def smoother_of(
    options: QuickestOptions, measurements: FloatArray, noises: FloatArray, start: Moments
) -> PieceSmoother:
    """Return the smoother for an environment; the arguments are those of `PieceSmoother`."""
    return PieceSmoother(
        measurements,
        noises,
        start,
        options.motions,
        options.tau,
        options.process_variance,
        options.speed,
        options.drift_variance,
        options.freedom,
    )


def starts_of(
    start: Moments | None, position: FloatArray, noise: FloatArray, options: QuickestOptions
) -> tuple[FloatArray, Moments]:
    """Return where an object may have been one tick before its first measurement.

    Without a start what is said of the position has little weight beside the measurement.

    Args:
        start: estimate (4,) and covariance (4, 4); None if nothing is known.
        position: (2,) that was measured first [m].
        noise: (3,) xx, xy, yy of its covariance [m^2].
        options: with the speed of the object.

    Returns:
        (k, 14) starts with headings all around, see `lattice.walk_lattice`, and one estimate with
        its covariance for all of them.
    """
    if start is not None:
        return np.array([[*start[0], *start[1][TRIANGLE]]]), start
    angles = 2.0 * np.pi * np.arange(8) / 8
    x, y = position
    wide = 25.0 * max(noise[0], noise[2])
    starts = []
    for c, s in zip(np.cos(angles), np.sin(angles), strict=True):
        vx, vy = options.speed * c, options.speed * s
        P = np.diag([wide, (0.5 * options.speed) ** 2] * 2)
        starts.append([x - options.tau * vx, vx, y - options.tau * vy, vy, *P[TRIANGLE]])
    velocity = 2.0 * options.speed
    P = np.diag([wide + (options.tau * velocity) ** 2, velocity**2] * 2)
    return np.array(starts), (np.array([x, 0.0, y, 0.0]), P)


@compiled
def _choose(
    probabilities: FloatArray,
    weights: FloatArray,
    cost: float,
    total: FloatArray,
    before: IntArray,
    modes: IntArray,
) -> None:
    """Write the sequence of modes whose value is the largest, by dynamic programming.

    Args:
        probabilities: (T, M) what each mode is worth at a tick.
        weights: (T,) by which these are multiplied.
        cost: of a change.
        total: (M,) value of each mode before the first tick; that at the last one is written.
        before: (T, M) memory: mode at the tick before, of the best sequence with a mode at a tick.
        modes: (T,) of the sequence, written.
    """
    for k in range(len(modes)):
        best = total.argmax()
        changed = total[best] - cost
        for mode in range(total.size):
            stays = total[mode] >= changed
            before[k, mode] = mode if stays else best
            total[mode] = max(total[mode], changed) + weights[k] * probabilities[k, mode]
    mode = int(total.argmax())
    for k in range(len(modes) - 1, -1, -1):
        modes[k] = mode
        mode = before[k, mode]


def choose_modes(
    probabilities: FloatArray, weights: FloatArray, cost: float = 2.0, last: int | None = None
) -> IntArray:
    """Return the modes (T,) with the largest expected number of right rows, less the cost of each
    change.

    Args:
        probabilities: (T, M) what each mode is worth at a tick.
        weights: (T,) 1 at ticks with a row, 0 at others, whose mode is that of the largest
            probability still.
        cost: of a change.
        last: mode before the first tick; None is not known.
    """
    modes = np.zeros(len(probabilities), int)
    before = np.zeros(probabilities.shape, np.int32)
    total = np.zeros(probabilities.shape[1])
    if last is not None:
        total -= cost
        total[last] = 0.0
    run_compiled(_choose, probabilities, np.maximum(weights, 1e-6), cost, total, before, modes)
    return modes
