"""Classical deciders: Wald's test and ATE around it, tests between all hypotheses, a fixed decision time."""

from baselines.deciders.decider import Decider
from baselines.deciders.fixed_time import FixedTimeDecider
from baselines.deciders.msprt import GapDecider, MSPRTDecider
from baselines.deciders.sprt import SPRTDecider, sprt_test, sprt_thresholds
from baselines.filters.recording import first_estimate
from baselines.recordings.ate import Tracks, track

__all__ = [
    "Decider",
    "FixedTimeDecider",
    "GapDecider",
    "MSPRTDecider",
    "SPRTDecider",
    "Tracks",
    "first_estimate",
    "sprt_test",
    "sprt_thresholds",
    "track",
]
