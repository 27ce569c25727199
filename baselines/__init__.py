"""Classical deciders: Wald's test, the algorithm ATE around it, and a fixed decision time."""

from baselines.ate import Tracks, first_estimate, track
from baselines.decider import Decider
from baselines.fixed_time import FixedTimeDecider
from baselines.sprt import SPRTDecider, sprt_test, sprt_thresholds

__all__ = [
    "Decider",
    "FixedTimeDecider",
    "SPRTDecider",
    "Tracks",
    "first_estimate",
    "sprt_test",
    "sprt_thresholds",
    "track",
]
