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
from hybrid_env.core.banks.bank import FilterModel
from hybrid_env.live import SQUARE
from hybrid_env.options import WorldOptions
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.sensors import Fused, Radar

# Measurement variance and tick in the units of the filters.
VARIANCE, TICK = 0.1, 0.1
# For the first state.
MOST_TICKS = 50
# Measurements.
FEWEST = 3
# Probability of a mode that counts as known.
SURE = 0.6


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


def decide_recording(
    grid: TickGrid,
    model: TrackModel,
    tracker: OnlineTracker,
    *,
    lengths: Sequence[int] = (),
    start: FloatArray | None = None,
) -> list[TickDecisions]:
    """Run a decider over the pieces of a recording, whose tracker has the options of
    `ModelUnits.options`. Lengths are ticks between the known switches, see `check_lengths`; `start`
    is the exact state (4,) [x, vx, y, vy] one tick before the first measurement, None starts from
    the first measurements.
    """
    check_lengths(grid, lengths)
    return [
        _decide_piece(piece, grid.radar, model, tracker, lengths, start) for piece in grid.pieces
    ]


def check_lengths(grid: TickGrid, lengths: Sequence[int]) -> None:
    """Raise `ArgumentError` if the ticks between known switches do not fit the recording."""
    if lengths and len(grid.pieces) > 1:
        raise reject(
            "lengths",
            tuple(lengths),
            f"none with {len(grid.pieces) - 1} gaps, or a longer --gap",
        )
    if lengths and sum(lengths) != grid.total:
        allowed = f"lengths whose sum is {grid.total}, the number of ticks, not {sum(lengths)}"
        raise reject("lengths", tuple(lengths), allowed)


def _decide_piece(
    piece: Piece,
    radar: Radar | None,
    model: TrackModel,
    tracker: OnlineTracker,
    lengths: Sequence[int],
    start: FloatArray | None,
) -> TickDecisions:
    units = ModelUnits.of(model)
    scales = np.array([*units, *units])
    origin = np.zeros(4)
    measured = ~np.isnan(piece.measurements[:, 0])
    origin[::2] = piece.measurements[measured][0] if radar is None else radar.position
    points, rates = (piece.measurements - origin[::2]) * units.length, piece.rates * units.velocity
    options: Any = tracker.options
    total = len(points)
    M = options.hypotheses
    found = TickDecisions(
        np.zeros(total, np.int64),
        np.zeros(total, np.bool_),
        np.empty((total, M)),
        np.empty((total, 4)),
        np.empty((total, 4, 4)),
        np.full((len(lengths), 4), -1),
    )
    # Whether it is that of the decider.
    has_mode = np.zeros(total, np.bool_)
    if start is not None:
        tracker.begin((start - origin) * scales, np.zeros((4, 4)))
    else:
        # From the first measurements, with known switches those of the first piece.
        known = slice(lengths[0] if lengths else None)
        first = first_state(
            points[known],
            options,
            0.0 if lengths else options.assumed_hazard,
            rates[known],
        )
        estimate, covariance, mode = first or (None, None, None)
        # An announced switch begins the first piece, whatever the mode before it.
        tracker.begin(estimate, covariance, None if lengths else mode)
    ends = np.cumsum(lengths, dtype=np.int64)
    found.pieces[:, 0], found.pieces[:, 1] = ends - lengths, ends
    switches = dict(zip(found.pieces[:, 0].tolist(), lengths, strict=True))
    for k, ((x, y), seen) in enumerate(zip(points.tolist(), measured.tolist(), strict=True)):
        if k in switches:
            tracker.switch(switches[k])
        measurement: Any = (x, y) if seen else None
        # A radar at the origin.
        if seen and options.sensors:
            measurement = Fused((x, y), options.sensors[0].noise(x, y), (float(rates[k]),))
        now = tracker.update(measurement)
        found.modes[k], found.decided[k] = now.mode, now.decided
        has_mode[k] = now.decided if lengths else not tracker.collects
        found.probabilities[k] = now.probabilities
        found.estimates[k], found.covariances[k] = now.estimate, now.covariance
        if now.recalculated is not None:
            again = slice(k + 1 - len(now.recalculated[0]), k + 1)
            found.estimates[again], found.covariances[again] = now.recalculated
            found.modes[again] = now.mode
    found.estimates[:] = found.estimates / scales + origin
    found.covariances[:] /= np.outer(scales, scales)
    # One without a decision is as in the options.
    for one in found.pieces:
        first, end = one[:2]
        one[2], decided = found.modes[end - 1], np.flatnonzero(found.decided[first:end])
        if decided.size:
            one[3] = first + decided[0]
        elif options.undecided == "likeliest":
            one[2] = found.probabilities[end - 1].argmax()
    stated = np.flatnonzero(has_mode)
    if stated.size:
        found.modes[: stated[0]] = found.modes[stated[0]]
    if lengths:
        return found
    # The runs of one mode.
    begin = np.flatnonzero(np.diff(found.modes, prepend=-1))
    end = np.append(begin[1:], len(found.modes))
    when = np.where(found.decided[begin], begin, -1)
    decided = np.flatnonzero(found.decided[: end[0]])
    if decided.size:
        when[0] = decided[0]
    return replace(found, pieces=np.stack([begin, end, found.modes[begin], when], axis=1))


def first_state(
    measurements: FloatArray,
    options: WorldOptions | QuickestOptions,
    hazard: float,
    rates: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray, int | None] | None:
    """Return the state one tick before the first measurement, seen backwards; None with too few
    measurements. A bank for known switches takes its first estimate as exact, and an error there
    passes on from piece to piece; a straight line is not good enough if the object turns by much in
    a tick. So the interacting multiple model bank runs backwards over at most 50 ticks of the
    measurements (T, 2) [m], NaN without one but the first, and range rates (T,) of a radar; the
    hazard is the probability of a switch in a tick. They are used twice, which a live sensor does
    not allow. Returns the estimate (4,) [x, vx, y, vy], its covariance (4, 4), and the mode, None
    if none is probable enough.
    """
    used = measurements[:MOST_TICKS]
    if (~np.isnan(used[:, 0])).sum() < FEWEST:
        return None
    # The last tick only predicts.
    backwards = np.vstack([used[::-1], np.full((1, 2), np.nan)])
    chunks = make_chunks([backwards])
    if rates is not None and options.sensors and isinstance(options.sensors[0], Radar):
        rates = np.append(-rates[:MOST_TICKS][::-1], np.nan)
        chunks = make_chunks([backwards], None, [rates], options.sensors[0])
    x, y = map(float, np.broadcast_to(options.variances, 2))
    radii, M = np.array(options.radii), options.hypotheses
    model = FilterModel(options.tau, options.process_variance, x, y, 1.0 - hazard, hazard / (M - 1))
    output = recorded_pass(chunks, radii, model)
    reverse = np.array([1.0, -1.0, 1.0, -1.0])
    covariance = chunks.block["covariance"][0, :, 0][SQUARE] * np.outer(reverse, reverse)
    # A left turn seen backwards is a right turn.
    n = len(radii)
    seen = output.probabilities[0, -2, :, 0]
    probabilities = np.concatenate([seen[:1], seen[1 + n :], seen[1 : 1 + n]])
    best = int(probabilities.argmax())
    mode = best if probabilities[best] > SURE else None
    return chunks.block["estimate"][0, :, 0] * reverse, covariance, mode
