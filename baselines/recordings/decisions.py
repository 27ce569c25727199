"""A decider on a recording: mode, probabilities, estimate and covariance at every row."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from baselines.recordings.imm_pass import TrackModel
from baselines.recordings.recording import Recording
from baselines.recordings.ticks import Piece, TickGrid
from baselines.recordings.tracker import OnlineTracker
from hybrid_env.checks import BoolArray, FloatArray, IntArray
from hybrid_env.live import SQUARE
from hybrid_env.sensors import Fused, Radar


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
    # (K, 4) first row, end, mode, and row of the decision, -1 without one.
    pieces: IntArray


def decide_piece(
    recording: Recording,
    piece: Piece,
    model: TrackModel,
    tracker: OnlineTracker,
    lengths: Sequence[int] = (),
    start: FloatArray | None = None,
) -> RowDecisions:
    """Give the rows of a piece of a recording one by one to a tracker in its units. Lengths are
    ticks between the known switches; `start` is the exact state (4,) [x, vx, y, vy] one tick before
    the first measurement, None starts from the first measurements.
    """
    options: Any = tracker.options
    covariance: FloatArray | None = np.zeros((4, 4))
    if start is None and lengths:
        start, covariance = first_state(piece, recording.radar, model, lengths)
    tracker.begin(start, None if start is None else covariance)
    total = piece.end - piece.first
    modes = np.zeros(total, int)
    decided = np.zeros(total, bool)
    begun = np.zeros(total, bool)
    probabilities = np.empty((total, options.hypotheses))
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
            point = tracker.units.position(positions[row])
            for sensor in options.sensors:
                rate = float(tracker.units.scales[1] * piece.rates[tick])
                point = Fused(point.position, sensor.noise(*point.position), (rate,))
        now = tracker.advance(tick - before, point, float(piece.late[row]))
        before = tick
        begun[row] = tracker.begun
        modes[row], decided[row], probabilities[row], estimates[row], covariances[row] = now[:5]
        turns[row] = now.turn
        if now.recalculated is not None:
            first = tick + 1 - len(now.recalculated[0])
            again = np.arange(np.searchsorted(piece.ticks, first), row + 1)
            of_row = piece.ticks[again] - first
            estimates[again], covariances[again] = (each[of_row] for each in now.recalculated)
            estimates[again, ::2] += piece.late[again, None] * estimates[again, 1::2]
            modes[again] = now.mode
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
        elif lengths and end > first and options.undecided == "likeliest":
            segment[2] = probabilities[end - 1].argmax()
    # A piece between two rows has none.
    pieces = pieces[ends > begins]
    return RowDecisions(modes, decided, probabilities, estimates, covariances, turns, pieces)


def first_state(
    piece: Piece,
    radar: Radar | None,
    model: TrackModel,
    lengths: Sequence[int],
) -> tuple[FloatArray | None, FloatArray | None]:
    """Return estimate (4,) [x, vx, y, vy] and covariance (4, 4) one tick before the first
    measurement of a piece with known switches, seen backwards; nothing with too few measurements or
    with modes of the user. A bank for known switches takes its first estimate as exact, and an
    error there passes on from piece to piece; a straight line is not good enough if the object
    turns by much in a tick. So the interacting multiple model bank runs backwards over at most 50
    ticks of the first of `lengths`. They are used twice, which a live sensor does not allow.
    """
    ticks = min(50, lengths[0], len(piece.measurements))
    # The last tick only predicts.
    values = np.pad(piece.measurements[:ticks][::-1], ((0, 1), (0, 0)), constant_values=np.nan)
    if np.count_nonzero(~np.isnan(values[:, 0])) < 3 or model.modes:
        return None, None
    rates = np.append(-piece.rates[:ticks][::-1], np.nan)
    rows = np.arange(ticks + 1)
    backwards = Piece(0, ticks + 1, rows, np.zeros(ticks + 1), values, rates)
    model = replace(model, duration=math.inf)
    result, _ = model.run(TickGrid(model.tau, (backwards,), 0, 0.0, radar), (), ticks)
    origin = np.zeros(4)
    origin[::2] = values[~np.isnan(values[:, 0])][0] if radar is None else radar.position
    units = np.array([1.0, -1.0 / model.tau, 1.0, -1.0 / model.tau])
    units *= math.sqrt(model.measurement_variance)
    covariance = result.block["covariance"][0, :, 0][SQUARE] * np.outer(units, units)
    return result.block["estimate"][0, :, 0] * units + origin, covariance
