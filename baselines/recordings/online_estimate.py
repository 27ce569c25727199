"""What a live tracker knows after a measurement, and what became of the measurement."""

import math
from typing import Literal, NamedTuple, TypeAlias

from baselines.estimation.turns import TurnEstimate
from baselines.rules.fixed_lag import Settled
from hybrid_env.checks import FloatArray

Status: TypeAlias = Literal["begun", "used", "missing", "far", "repeated", "late", "dropped"]
"""What became of a measurement, see `OnlineEstimate`."""


class HeightEstimate(NamedTuple):
    """What is known of a height after a measurement.

    Attributes:
        mode: 0 level, 1 climb, 2 descend.
        probabilities: (3,) of them.
        estimate: (2,) [z, vz], as that of the plane; NaN before the first height.
        covariance: (2, 2) of the estimate.
        status: what became of the height, see `OnlineEstimate`.
    """

    mode: int
    probabilities: FloatArray
    estimate: FloatArray
    covariance: FloatArray
    status: Status


class OnlineEstimate(NamedTuple):
    """What is known after a measurement.

    Attributes:
        mode: the stated or last declared mode, a place in `OnlineTracker.mode_names`: 0 straight,
            then the left and the right turns in the order of the radii.
        decided: False while the first measurements are collected; then with unknown switches as
            long as the mode is only assumed: until the evidence for it reaches the threshold of the
            decider, without one its probability is .5, or a decider with a threshold changes its
            statement. True from the start if `begin` is told the mode. With announced switches
            False from a switch to the declaration of its mode; then `mode` is the one before.
        probabilities: (M,) of the modes.
        estimate: (4,) [x, vx, y, vy] at the time of the measurement, in the units of the
            measurements, with a projection in metres; NaN before the first measurement.
        covariance: (4, 4) of the estimate; variances that nothing is known of are infinite.
        status: what became of the measurement: "begun", it is the first one of a track; "used";
            "missing", there was none; "far", no motion of the track explains it; "repeated", it has
            the time or, although the object moves, the position of the last one; "late", it was
            made before the last one, and all that came after it has been filtered again; "dropped",
            it is too late or has no tick of its own.
        position: (x, y) of the estimate; with a projection latitude and longitude [deg].
        turn: speed and radius of the object with their deviations, in the units of the estimate.
            The radius is estimated although the hypothesis names another one.
        settled: with a `lag` of the tracker, what is now known of the tick so many ticks before the
            last one, in the units of the estimate; None before there is one. After an update over
            several ticks, those between are not returned.
        height: after a position with a third coordinate.
    """

    mode: int
    decided: bool
    probabilities: FloatArray
    estimate: FloatArray
    covariance: FloatArray
    status: Status = "used"
    position: tuple[float, float] = (math.nan, math.nan)
    turn: TurnEstimate = TurnEstimate(math.nan, math.nan, math.nan, math.nan)
    settled: Settled | None = None
    height: HeightEstimate | None = None
