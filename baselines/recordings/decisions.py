"""A decider on a recording: mode, probabilities, estimate and covariance at every tick.

The recording is brought to the units in which the measurement variance is 0.1 and the tick 0.1, those of the
default environment. So a decider sees the same numbers in whatever units the recording is, and the results do
not depend on them. `OnlineTracker` puts the decider behind the bank.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baselines.recordings.first_state import first_state
from baselines.recordings.model_fit import TrackModel
from baselines.recordings.ticks import Stretch, TickGrid
from baselines.rules.tracker import OnlineTracker
from hybrid_env.checks import reject
from hybrid_env.options import WorldOptions

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

VARIANCE, TICK = 0.1, 0.1
"""Measurement variance and tick in the units of the filters."""

PROGRESS_TICKS = 2000


class ModelUnits(NamedTuple):
    """Scales from the units of a recording to those of the filters.

    Attributes:
        length: of lengths.
        velocity: of velocities.
    """

    length: float
    velocity: float

    @classmethod
    def of(cls, model: TrackModel) -> "ModelUnits":
        """Return the units in which R and tick are those of the filters."""
        length = math.sqrt(VARIANCE / model.measurement_variance)
        return cls(length, length * model.tau / TICK)

    @property
    def state(self) -> FloatArray:
        """Scales of [x, vx, y, vy]."""
        return np.array([self.length, self.velocity, self.length, self.velocity])

    def options(self, model: TrackModel) -> dict[str, object]:
        """Return the options of an environment with the model of a recording."""
        return {
            "radii": tuple(radius * self.length for radius in model.radii),
            "speed": model.speed * self.velocity,
            "tau": TICK,
            "process_variance": model.process_variance * self.velocity**2,
            "measurement_variance": VARIANCE,
        }


@dataclass(frozen=True, eq=False)
class TickDecisions:
    """Decisions at the T ticks of a stretch, in the units of the recording.

    Attributes:
        modes: (T,) stated or last decided mode. Ticks before the first decision have its mode.
        decided: (T,) False before the first statement, and with known switches before the decision of a
        piece. probabilities: (T, M) of the modes.
        estimates: (T, 4) [x, vx, y, vy].
        covariances: (T, 4, 4); infinite for the velocity after a single measurement.
        pieces: (K, 4) first tick, end, mode and tick of the decision of each piece, counted from 0; -1 for a
            piece without a decision. Without known switches a piece is a run of one mode.
    """

    modes: IntArray
    decided: NDArray[np.bool_]
    probabilities: FloatArray
    estimates: FloatArray
    covariances: FloatArray
    pieces: IntArray


def decide_recording(
    grid: TickGrid,
    model: TrackModel,
    tracker: OnlineTracker,
    *,
    lengths: Sequence[int] = (),
    start: FloatArray | None = None,
    on_progress: Callable[[float], None] | None = None,
) -> list[TickDecisions]:
    """Run a decider over a recording.

    Args:
        grid: the recording on ticks.
        model: of the recording.
        tracker: decider and bank, whose options are those of `ModelUnits.options`.
        lengths: ticks between the known switches; their sum is the number of ticks.
        start: (4,) exact state [x, vx, y, vy] one tick before the first measurement; None starts from the
        first
            measurements.
        on_progress: called now and then with the fraction that is done.

    Raises:
        ArgumentError: the lengths do not fit the recording.
    """
    check_lengths(grid, lengths)
    results, done = [], 0
    for stretch in grid.stretches:

        def report(ticks: int, before: int = done) -> None:
            if on_progress is not None:
                on_progress((before + ticks) / grid.total)

        results.append(_decide_stretch(stretch, model, tracker, lengths, start, report))
        done += len(stretch.measurements)
    return results


def check_lengths(grid: TickGrid, lengths: Sequence[int]) -> None:
    """Check the ticks between known switches.

    Raises:
        ArgumentError: they do not fit the recording.
    """
    if lengths and len(grid.stretches) > 1:
        raise reject(
            "lengths", tuple(lengths), f"none with {len(grid.stretches) - 1} gaps, or a longer --gap"
        )
    if lengths and sum(lengths) != grid.total:
        allowed = f"lengths whose sum is {grid.total}, the number of ticks, not {sum(lengths)}"
        raise reject("lengths", tuple(lengths), allowed)


def _decide_stretch(
    stretch: Stretch,
    model: TrackModel,
    tracker: OnlineTracker,
    lengths: Sequence[int],
    start: FloatArray | None,
    report: Callable[[int], None],
) -> TickDecisions:
    units = ModelUnits.of(model)
    scales, origin = units.state, np.zeros(4)
    first = stretch.measurements[~np.isnan(stretch.measurements[:, 0])][0]
    origin[::2] = first
    points = ((stretch.measurements - first) * units.length).tolist()
    measured = (~np.isnan(stretch.measurements[:, 0])).tolist()
    total, M = len(points), tracker.options.hypotheses
    found = TickDecisions(
        np.zeros(total, np.int64), np.zeros(total, np.bool_), np.empty((total, M)), np.empty((total, 4)),
        np.empty((total, 4, 4)), np.empty((len(lengths), 4), np.int64),
    )  # fmt: skip
    if start is not None:
        tracker.begin((start - origin) * scales, np.zeros((4, 4)))
    else:
        _begin_from_first(tracker, np.array(points)[: lengths[0]] if lengths else np.array(points))
    begins = dict(zip(np.cumsum([0, *lengths[:-1]]).tolist(), lengths, strict=True)) if lengths else {}
    piece = -1
    for k in range(total):
        if k in begins:
            if piece >= 0:
                _end_piece(found, piece, k, tracker)
            tracker.switch(begins[k])
            piece += 1
            found.pieces[piece] = k, k + begins[k], -1, -1
        now = tracker.update(tuple(points[k]) if measured[k] else None)
        found.modes[k], found.decided[k] = now.mode, now.decided
        found.probabilities[k], found.estimates[k], found.covariances[k] = now[2:]
        if k % PROGRESS_TICKS == 0:
            report(k)
    if lengths:
        _end_piece(found, piece, total, tracker)
    found.estimates[:] = found.estimates / scales + origin
    found.covariances[:] /= np.outer(scales, scales)
    stated = np.flatnonzero(found.decided)
    if stated.size:
        found.modes[: stated[0]] = found.modes[stated[0]]
    return found if lengths else _with_runs(found)


def _begin_from_first(tracker: OnlineTracker, points: FloatArray) -> None:
    """Begin a track whose first measurements are (T, 2), with known switches those of the first piece."""
    known = isinstance(tracker.options, WorldOptions)
    hazard = 0.0 if isinstance(tracker.options, WorldOptions) else tracker.options.assumed_hazard
    state = first_state(points, tracker.options, hazard)
    if state is None:
        tracker.begin()
    else:
        # an announced switch begins the first piece, whatever the mode before it
        tracker.begin(state.estimate, state.covariance, None if known else state.mode)


def _end_piece(found: TickDecisions, piece: int, end: int, tracker: OnlineTracker) -> None:
    """Write mode and decision of a piece; one that is undecided is decided as in the options."""
    first = int(found.pieces[piece, 0])
    decided = found.decided[first:end]
    if decided.any():
        when = first + int(decided.argmax())
        found.pieces[piece, 2:] = found.modes[when], when
        return
    assert isinstance(tracker.options, WorldOptions)
    likeliest = tracker.options.undecided == "likeliest"
    found.pieces[piece, 2] = int(found.probabilities[end - 1].argmax()) if likeliest else found.modes[end - 1]


def _with_runs(found: TickDecisions) -> TickDecisions:
    """Return decisions whose pieces are the runs of one mode."""
    first = np.flatnonzero(np.diff(found.modes, prepend=-1))
    end = np.append(first[1:], len(found.modes))
    when = np.where(found.decided[first], first, -1)
    stated = np.flatnonzero(found.decided)
    if stated.size and not found.decided[0]:
        when[0] = stated[0]
    pieces = np.stack([first, end, found.modes[first], when], axis=1)
    return TickDecisions(
        found.modes, found.decided, found.probabilities, found.estimates, found.covariances, pieces
    )
