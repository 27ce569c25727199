"""A decider on a recording: mode, probabilities, estimate and covariance at every tick."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from baselines.recordings.imm_pass import TrackModel
from baselines.recordings.ticks import Piece, TickGrid
from baselines.rules.tracker import OnlineTracker
from hybrid_env.checks import BoolArray, FloatArray, IntArray
from hybrid_env.live import SQUARE
from hybrid_env.sensors import Fused, Radar


class TickDecisions(NamedTuple):
    """Decisions at the T ticks of a piece between gaps, in the units of the recording. In `pieces`,
    one with known switches lies between two of them, and its mode is that at its end; otherwise it
    is a run of one mode.
    """

    # (T,) stated or last decided; with known switches, ticks before the first one have its mode.
    modes: IntArray
    # (T,) see `OnlineEstimate.decided`
    decided: BoolArray
    # (T, M) of the modes.
    probabilities: FloatArray
    # (T, 4) [x, vx, y, vy]
    estimates: FloatArray
    # (T, 4, 4); infinite for the velocity after a single measurement.
    covariances: FloatArray
    # (K, 4) first tick, end, mode, and tick of the decision, -1 without one.
    pieces: IntArray


def decide_piece(
    piece: Piece,
    radar: Radar | None,
    model: TrackModel,
    tracker: OnlineTracker,
    lengths: Sequence[int] = (),
    start: FloatArray | None = None,
) -> TickDecisions:
    """Run a decider over a piece of a recording, whose tracker has the options of
    `TrackModel.options`. Lengths are ticks between the known switches; `start` is the exact state
    (4,) [x, vx, y, vy] one tick before the first measurement, None starts from the first
    measurements.
    """
    options: Any = tracker.options
    scales = model.scales
    origin = np.zeros(4)
    measured = piece.measured
    origin[::2] = piece.measurements[measured][0] if radar is None else radar.position
    points = (piece.measurements - origin[::2]) * scales[0]
    rates = piece.rates * scales[1]
    total = len(points)
    modes = np.zeros(total, int)
    decided = np.zeros(total, bool)
    probabilities = np.empty((total, options.hypotheses))
    estimates = np.empty((total, 4))
    covariances = np.empty((total, 4, 4))
    covariance: FloatArray | None = np.zeros((4, 4))
    mode = None
    if start is None:
        start, covariance, mode = first_state(piece, radar, model, lengths)
    if start is None or covariance is None:
        tracker.begin()
    else:
        # An announced switch begins the first piece, whatever the mode before it.
        mode = None if lengths else mode
        tracker.begin((start - origin) * scales, covariance * np.outer(scales, scales), mode)
    switches = dict(zip(np.cumsum([0, *lengths[:-1]]).tolist(), lengths, strict=False))
    for k, point in enumerate(points):
        if k in switches:
            tracker.switch(switches[k])
        measurement: Any = None
        if measured[k]:
            measurement = x, y = tuple(point.tolist())
            # A radar at the origin.
            for sensor in options.sensors:
                measurement = Fused((x, y), sensor.noise(x, y), (float(rates[k]),))
        now = tracker.update(measurement)
        modes[k], decided[k], probabilities[k], estimates[k], covariances[k] = now[:5]
        if now.recalculated is not None:
            again = slice(k + 1 - len(now.recalculated[0]), k + 1)
            estimates[again], covariances[again] = now.recalculated
            modes[again] = now.mode
    estimates = estimates / scales + origin
    covariances /= np.outer(scales, scales)
    if not lengths:
        # Runs of one mode.
        begins: IntArray = np.flatnonzero(np.diff(modes, prepend=-1))
        ends: IntArray = np.append(begins[1:], total)
    else:
        ends = np.cumsum(lengths)
        begins = ends - np.asarray(lengths)
    pieces = np.stack([begins, ends, modes[ends - 1], np.full_like(ends, -1)], axis=1)
    for segment in pieces:
        first, end = segment[:2]
        seen = np.flatnonzero(decided[first:end])
        if seen.size:
            segment[3] = first + seen[0]
        elif lengths and options.undecided == "likeliest":
            segment[2] = probabilities[end - 1].argmax()
    if lengths and decided.any():
        modes[: decided.argmax()] = modes[decided.argmax()]
    return TickDecisions(modes, decided, probabilities, estimates, covariances, pieces)


def first_state(
    piece: Piece,
    radar: Radar | None,
    model: TrackModel,
    lengths: Sequence[int] = (),
) -> tuple[FloatArray | None, FloatArray | None, int | None]:
    """Return the state one tick before the first measurement of a piece, seen backwards; nothing
    with too few measurements. A bank for known switches takes its first estimate as exact, and an
    error there passes on from piece to piece; a straight line is not good enough if the object
    turns by much in a tick. So the interacting multiple model bank runs backwards over at most 50
    ticks, with known switches of the first of `lengths`. They are used twice, which a live sensor
    does not allow. Returns the estimate (4,) [x, vx, y, vy], its covariance (4, 4), and the mode,
    None if none is probable enough.
    """
    ticks = min(50, *lengths[:1], len(piece.measurements))
    # The last tick only predicts.
    values = np.pad(piece.measurements[:ticks][::-1], ((0, 1), (0, 0)), constant_values=np.nan)
    if np.count_nonzero(~np.isnan(values[:, 0])) < 3:
        return None, None, None
    rates = np.append(-piece.rates[:ticks][::-1], np.nan)
    rows = np.arange(ticks + 1)
    backwards = Piece(0, ticks + 1, rows, np.zeros(ticks + 1), values, rates)
    if lengths:
        model = replace(model, duration=math.inf)
    result, _ = model.run(TickGrid(model.tau, (backwards,), 0, 0.0, radar), (), ticks)
    origin = np.zeros(4)
    origin[::2] = values[~np.isnan(values[:, 0])][0] if radar is None else radar.position
    units = np.array([1.0, -1.0 / model.tau, 1.0, -1.0 / model.tau])
    units *= math.sqrt(model.measurement_variance)
    covariance = result.block["covariance"][0, :, 0][SQUARE] * np.outer(units, units)
    # A left turn seen backwards is a right turn.
    turns = result.probabilities[0, -2, 1:, 0]
    probabilities = [result.probabilities[0, -2, 0, 0], *np.roll(turns, len(turns) // 2)]
    best = int(np.argmax(probabilities))
    # Of a mode that counts as known.
    mode = best if probabilities[best] > 0.6 else None
    return result.block["estimate"][0, :, 0] * units + origin, covariance, mode
