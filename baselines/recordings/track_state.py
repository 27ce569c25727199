"""What a live tracker remembers of its track beside the arrays of its bank."""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

from baselines.recordings.clock import TickClock
from baselines.recordings.start import FirstMeasurements
from baselines.rules.fixed_lag import FixedLagSmoother, Settled
from hybrid_env.checks import AnyArray
from hybrid_env.sensors import Fused


@dataclass
class TrackState:
    """What a tracker knows of the present track beside the arrays of its bank."""

    # Stated or told before the first measurement; -1 if it is not known.
    mode: int
    # Whether the mode is only assumed, see `OnlineEstimate.decided`.
    assumed: bool
    clock: TickClock
    # First measurements; None once the bank has begun.
    collected: FirstMeasurements | None
    # Length of the segment that the next measurement begins.
    announced_ticks: int | None
    # Of the last measurement.
    time: float | None = None
    # Whether there was a measurement.
    measured: bool = False
    # Position and time of the last measurement.
    position: tuple[tuple[float, float], float] | None = None
    # Smallest step of a coordinate between two measurements.
    digit: float = math.inf
    # Measurements in a row, up to now, that repeat a position, are far, and agree.
    repeats: int = 0
    far: int = 0
    agreed: int = 0
    # With a lag of the tracker: from the first measurement on, and what it has returned last.
    smoother: FixedLagSmoother | None = None
    settled: Settled | None = None
    decider_state: Any = None
    episode_start: bool = True


class Snapshot(NamedTuple):
    """State after the measurement of a time, and the measurements that came after it."""

    time: float
    state: TrackState
    arrays: dict[str, AnyArray]
    # Times, and what was measured.
    times: list[float]
    points: list[Fused | None]
