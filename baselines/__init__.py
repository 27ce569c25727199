"""Classical decision rules: Wald's SPRT, MSPRT and gap rule, fixed decision time; ATE on recordings."""

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
