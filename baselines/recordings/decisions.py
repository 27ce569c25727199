"""A decider on a recording: mode, probabilities, estimate and covariance at every tick. The
recording is converted to units in which measurement variance and tick are 0.1, those of the default
environment, so that what a decider reads, and the results, do not depend on its units.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from baselines.recordings.imm_pass import make_chunks, recorded_pass
from baselines.recordings.model_fit import TrackModel
from baselines.recordings.ticks import Piece, TickGrid
from baselines.rules.tracker import OnlineTracker
from hybrid_env.checks import BoolArray, FloatArray, IntArray, reject
from hybrid_env.compiled import FilterModel
from hybrid_env.live import SQUARE
from hybrid_env.options import WorldOptions
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.sensors import Fused, Radar

# Measurement variance and tick in the units of the filters.
VARIANCE, TICK = 0.1, 0.1


class ModelUnits(NamedTuple):
    """Scales from the units of a recording to those of the filters, of lengths and velocities."""

    length: float
    velocity: float

    @classmethod
    def of(cls, model: TrackModel) -> "ModelUnits":
        """Return the units in which R and tick are those of the filters."""
        length = math.sqrt(VARIANCE / model.measurement_variance)
        return cls(length, length * model.tau / TICK)

    def options(self, model: TrackModel, radar: Radar | None = None) -> dict[str, object]:
        """Return the options of an environment with the model of a recording, and with its
        radar.
        """
        return {
            "sensors": () if radar is None else (radar.scaled(*self),),
            "radii": tuple(radius * self.length for radius in model.radii),
            "speed": model.speed * self.velocity,
            "tau": TICK,
            "process_variance": model.process_variance * self.velocity**2,
            "measurement_variance": VARIANCE,
        }


@dataclass(frozen=True, eq=False)
class TickDecisions:
    """Decisions at the T ticks of a piece between gaps, in the units of the recording. In `pieces`,
    one with known switches lies between two of them, and its mode is that at its end; otherwise it
    is a run of one mode.
    """

    # (T,) stated or last decided; ticks before the first one have its mode.
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


def check_lengths(grid: TickGrid, lengths: Sequence[int]) -> None:
    """Raise `ArgumentError` if the ticks between known switches do not fit the recording."""
    allowed = f"lengths whose sum is {grid.total}, the number of ticks, not {sum(lengths)}"
    if len(grid.pieces) > 1:
        allowed = f"none with {len(grid.pieces) - 1} gaps, or a longer --gap"
    if lengths and (len(grid.pieces) > 1 or sum(lengths) != grid.total):
        raise reject("lengths", tuple(lengths), allowed)


def decide_piece(
    piece: Piece,
    radar: Radar | None,
    model: TrackModel,
    tracker: OnlineTracker,
    lengths: Sequence[int],
    start: FloatArray | None,
) -> TickDecisions:
    """Run a decider over a piece of a recording, whose tracker has the options of
    `ModelUnits.options`. Lengths are ticks between the known switches, see `check_lengths`; `start`
    is the exact state (4,) [x, vx, y, vy] one tick before the first measurement, None starts from
    the first measurements.
    """
    units = ModelUnits.of(model)
    scales = np.array([*units, *units])
    origin = np.zeros(4)
    measured = piece.measured
    origin[::2] = piece.measurements[measured][0] if radar is None else radar.position
    points = (piece.measurements - origin[::2]) * units.length
    rates = piece.rates * units.velocity
    options: Any = tracker.options
    total = len(points)
    decisions = TickDecisions(
        np.zeros(total, int),
        np.zeros(total, bool),
        np.empty((total, options.hypotheses)),
        np.empty((total, 4)),
        np.empty((total, 4, 4)),
        np.empty((0, 4), int),
    )
    if start is not None:
        tracker.begin((start - origin) * scales, np.zeros((4, 4)))
    else:
        # From the first measurements, with known switches those of the first piece.
        known = slice(lengths[0] if lengths else None)
        hazard = 0.0 if lengths else options.assumed_hazard
        estimate, covariance, mode = first_state(points[known], options, hazard, rates[known])
        # An announced switch begins the first piece, whatever the mode before it.
        tracker.begin(estimate, covariance, None if lengths else mode)
    switches = dict(zip(np.cumsum([0, *lengths[:-1]]).tolist(), lengths, strict=False))
    # First tick with a mode of the decider.
    begun = total
    for k, ((x, y), seen) in enumerate(zip(points.tolist(), measured, strict=True)):
        if k in switches:
            tracker.switch(switches[k])
        measurement: Any = (x, y) if seen else None
        # A radar at the origin.
        if seen and options.sensors:
            measurement = Fused((x, y), options.sensors[0].noise(x, y), (float(rates[k]),))
        now = tracker.update(measurement)
        for name, value in zip(vars(decisions), now[:5], strict=False):
            getattr(decisions, name)[k] = value
        if now.recalculated is not None:
            again = slice(k + 1 - len(now.recalculated[0]), k + 1)
            decisions.estimates[again], decisions.covariances[again] = now.recalculated
            decisions.modes[again] = now.mode
        if now.decided if lengths else not tracker.collects:
            begun = min(begun, k)
    decisions.estimates[:] = decisions.estimates / scales + origin
    decisions.covariances[:] /= np.outer(scales, scales)
    pieces = _segments(decisions, lengths, options.undecided) if lengths else None
    if begun < total:
        decisions.modes[:begun] = decisions.modes[begun]
    return replace(decisions, pieces=_runs(decisions) if pieces is None else pieces)


def _segments(decisions: TickDecisions, lengths: Sequence[int], undecided: str) -> IntArray:
    """Return the pieces between known switches; the mode of one without a decision is as in the
    options.
    """
    ends = np.cumsum(lengths)
    pieces = np.stack([ends - lengths, ends, decisions.modes[ends - 1], np.full_like(ends, -1)], 1)
    for segment in pieces:
        first, end = segment[:2]
        decided = np.flatnonzero(decisions.decided[first:end])
        if decided.size:
            segment[3] = first + decided[0]
        elif undecided == "likeliest":
            segment[2] = decisions.probabilities[end - 1].argmax()
    return pieces


def _runs(decisions: TickDecisions) -> IntArray:
    """Return the runs of one mode."""
    begin = np.flatnonzero(np.diff(decisions.modes, prepend=-1))
    end = np.append(begin[1:], len(decisions.modes))
    when = np.where(decisions.decided[begin], begin, -1)
    decided = np.flatnonzero(decisions.decided[: end[0]])
    if decided.size:
        when[0] = decided[0]
    return np.stack([begin, end, decisions.modes[begin], when], axis=1)


def first_state(
    measurements: FloatArray,
    options: WorldOptions | QuickestOptions,
    hazard: float,
    rates: FloatArray,
) -> tuple[FloatArray | None, FloatArray | None, int | None]:
    """Return the state one tick before the first measurement, seen backwards; nothing with too few
    measurements. A bank for known switches takes its first estimate as exact, and an error there
    passes on from piece to piece; a straight line is not good enough if the object turns by much in
    a tick. So the interacting multiple model bank runs backwards over at most 50 ticks of the
    measurements (T, 2) [m], NaN without one but the first, and range rates (T,) of a radar; the
    hazard is the probability of a switch in a tick. They are used twice, which a live sensor does
    not allow. Returns the estimate (4,) [x, vx, y, vy], its covariance (4, 4), and the mode, None
    if none is probable enough.
    """
    # For the first state.
    most_ticks = 50
    used = measurements[:most_ticks]
    # Measurements.
    if (~np.isnan(used[:, 0])).sum() < 3:
        return None, None, None
    # The last tick only predicts.
    backwards = [np.vstack([used[::-1], np.full((1, 2), np.nan)])]
    radar: Any = next(iter(options.sensors), None)
    rates = np.append(-rates[:most_ticks][::-1], np.nan)
    chunks = make_chunks(backwards, None, [rates], radar)
    x, y = map(float, np.broadcast_to(options.variances, 2))
    radii = np.array(options.radii)
    M = options.hypotheses
    model = FilterModel(options.tau, options.process_variance, x, y, 1.0 - hazard, hazard / (M - 1))
    output = recorded_pass(chunks, radii, model)
    reverse = np.array([1.0, -1.0, 1.0, -1.0])
    covariance = chunks.block["covariance"][0, :, 0][SQUARE] * np.outer(reverse, reverse)
    # A left turn seen backwards is a right turn.
    straight, left, right = np.split(output.probabilities[0, -2, :, 0], [1, 1 + len(radii)])
    probabilities = np.concatenate([straight, right, left])
    best = int(probabilities.argmax())
    # Probability of a mode that counts as known.
    mode = best if probabilities[best] > 0.6 else None
    return chunks.block["estimate"][0, :, 0] * reverse, covariance, mode
