"""Mode, probabilities, estimate and covariance at every row of a recording: with hindsight, or as a
decider on a live sensor would state them.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from baselines.recordings.recording import Recording
from baselines.recordings.sensor_units import SensorUnits
from baselines.recordings.ticks import Piece
from baselines.recordings.tracker import OnlineTracker
from baselines.rules.hindsight import PROCESS_SHARE, smooth_modes
from hybrid_env.checks import BoolArray, FloatArray, IntArray
from hybrid_env.compiled import MOST_RATES
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.sensors import Fused


class RowDecisions(NamedTuple):
    """Decisions at the n rows of a piece between gaps, in the units of the recording. In `pieces`,
    one with known switches lies between two of them, and its mode is that at its end; otherwise it
    is a run of one mode.
    """

    # (n,) stated or last decided; rows before the first decision have its mode.
    modes: IntArray
    # (n,) see `OnlineEstimate.decided`
    decided: BoolArray
    # (n, M) of the modes.
    probabilities: FloatArray
    # (n, 4) [x, vx, y, vy]
    estimates: FloatArray
    # (n, 4, 4); infinite for the velocity after a single measurement.
    covariances: FloatArray
    # (n, 4) see `Turn`
    turns: FloatArray
    # (K, 4) first row, end, mode, and row of the decision, -1 without one and with hindsight.
    pieces: IntArray
    # (K, 2) times of the rows between which each piece begins with a probability of .95; NaN live.
    moments: FloatArray


def smooth_piece(
    recording: Recording,
    piece: Piece,
    options: QuickestOptions,
    units: SensorUnits,
    lengths: Sequence[int] = (),
    start: FloatArray | None = None,
) -> RowDecisions:
    """Decide a piece of a recording with hindsight, see `hindsight.smooth_modes`.

    Args:
        recording: in its own units.
        piece: between two gaps.
        options: the model, of unknown switches.
        units: of the recording and the options.
        lengths: ticks between switches that are known.
        start: exact state (4,) one tick before the first measurement; None is not known.
    """
    times = piece.times(recording.times)
    values = (piece.measurements - units.origin_at(times)[..., ::2]) * units.scales[0]
    for sensor in options.sensors:
        noises = np.tile([1.0, 0.0, 1.0], (len(values), 1))
        seen = [sensor.noise(x, y) for x, y in values[piece.measured].tolist()]
        noises[piece.measured] = np.array(seen) / options.variances[0]
        rates = np.full((len(values), MOST_RATES), np.nan)
        rates[:, : sensor.rates] = units.rates(piece.rates)
        values = np.hstack([values, noises, rates])
    known = None
    if start is not None:
        known = units.start(start, np.zeros((4, 4)), times[0] - units.second * options.tau)
    switches = np.cumsum([0, *lengths[:-1]]).tolist() if lengths else None
    result = smooth_modes(values, options, known, switches, process_share=PROCESS_SHARE)
    ticks = piece.ticks
    moments = result.estimates[ticks], result.covariances[ticks]
    estimates, covariances = units.moments(*moments, times[ticks])
    estimates[:, ::2] += piece.late[:, None] * estimates[:, 1::2]
    borders = np.searchsorted(ticks, np.append(result.pieces[:, 0], len(values)))
    pieces = np.stack([borders[:-1], borders[1:], result.pieces[:, 2]], axis=1)
    # A piece between two rows has none.
    kept = pieces[:, 1] > pieces[:, 0]
    first_rows = np.searchsorted(ticks, result.moments[kept]).clip(max=len(ticks) - 1)
    return RowDecisions(
        result.modes[ticks],
        np.ones(len(ticks), bool),
        result.probabilities[ticks],
        estimates,
        covariances,
        result.turns[ticks] / units.scales[[1, 1, 0, 0]],
        np.pad(pieces[kept], ((0, 0), (0, 1)), constant_values=-1),
        recording.times[piece.first + first_rows],
    )


def decide_piece(
    recording: Recording,
    piece: Piece,
    tracker: OnlineTracker,
    lengths: Sequence[int] = (),
    start: FloatArray | None = None,
) -> RowDecisions:
    """Give the rows of a piece of a recording one by one to a tracker in its units. Lengths are
    ticks between the known switches; `start` is the exact state (4,) [x, vx, y, vy] one tick before
    the first measurement, None starts from the first measurements.
    """
    options: Any = tracker.options
    times = recording.times[piece.first : piece.end].tolist()
    covariance = None if start is None else np.zeros((4, 4))
    tracker.begin(start, covariance, time=times[0] - tracker.tau)
    total = piece.end - piece.first
    modes = np.zeros(total, int)
    decided = np.zeros(total, bool)
    begun = np.zeros(total, bool)
    probabilities = np.empty((total, len(tracker.mode_names)))
    estimates = np.empty((total, 4))
    covariances = np.empty((total, 4, 4))
    turns = np.empty((total, 4))
    switches = list(zip(np.cumsum([0, *lengths[:-1]]).tolist(), lengths, strict=False))
    positions = recording.positions[piece.first : piece.end].tolist()
    used = piece.measured[piece.ticks] & (np.diff(piece.ticks, prepend=-1) > 0)
    used &= recording.measured[piece.first : piece.end]
    before = -1
    for row, tick in enumerate(piece.ticks.tolist()):
        while switches and switches[0][0] <= tick:
            switch, length = switches.pop(0)
            if switch > before + 1:
                tracker.advance(switch - 1 - before, None)
                before = switch - 1
            tracker.switch(length)
        point = None
        if used[row]:
            point = tracker.units.position(positions[row], times[row])
            for sensor in options.sensors:
                rates = tuple(tracker.units.rates(piece.rates[tick]).tolist())
                point = Fused(point.position, sensor.noise(*point.position), rates)
        tracker.time = times[row]
        now = tracker.advance(tick - before, point, float(piece.late[row]))
        before = tick
        begun[row] = tracker.begun
        modes[row], decided[row], probabilities[row], estimates[row], covariances[row] = now[:5]
        turns[row] = now.turn
    # Before the first decision the mode is only assumed; without one, that of the bank.
    first = (decided if decided.any() else begun).argmax()
    modes[:first] = modes[first]
    if not lengths:
        # Runs of one mode.
        begins: IntArray = np.flatnonzero(np.diff(modes, prepend=-1))
        ends: IntArray = np.append(begins[1:], total)
    else:
        ends = np.searchsorted(piece.ticks, np.cumsum(lengths))
        begins = np.append(0, ends[:-1])
    pieces = np.stack([begins, ends, modes[ends - 1], np.full_like(ends, -1)], axis=1)
    for segment in pieces:
        first, end = segment[:2]
        seen = np.flatnonzero(decided[first:end])
        if seen.size:
            segment[3] = first + seen[0]
        elif lengths and end > first:
            segment[2] = probabilities[end - 1].argmax()
    # A piece between two rows has none.
    pieces = pieces[ends > begins]
    moments = np.full((len(pieces), 2), np.nan)
    arrays = modes, decided, probabilities, estimates, covariances, turns
    return RowDecisions(*arrays, pieces, moments)
