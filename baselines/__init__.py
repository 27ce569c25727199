"""Classical decision rules: Wald's SPRT, MSPRT and gap rule, fixed decision time; ATE on recordings.

For unknown switch moments: a threshold, CUSUM, Shiryaev-Roberts, the windowed generalized likelihood ratio,
the detector of Golubkov 2020 and a beam of histories.
`OnlineTracker` puts a rule behind a live sensor.
"""

from baselines.deciders.decider import Decider
from baselines.deciders.fixed_time import FixedTimeDecider
from baselines.deciders.msprt import GapDecider, MSPRTDecider
from baselines.deciders.sprt import SPRTDecider, sprt_test, sprt_thresholds
from baselines.filters.recording import first_estimate
from baselines.online.tracker import OnlineEstimate, OnlineTracker
from baselines.quickest.beam import BeamDecider
from baselines.quickest.change_detection import CusumDecider, ShiryaevRobertsDecider
from baselines.quickest.metrics import StatementMetrics, measure_statements
from baselines.quickest.restarted import GLRDecider, MeanRatioDecider
from baselines.quickest.statements import Statements, record_statements
from baselines.quickest.threshold import ThresholdDecider
from baselines.recordings.ate import Tracks, track_ate

__all__ = [
    "BeamDecider",
    "CusumDecider",
    "Decider",
    "FixedTimeDecider",
    "GLRDecider",
    "GapDecider",
    "MSPRTDecider",
    "MeanRatioDecider",
    "OnlineEstimate",
    "OnlineTracker",
    "SPRTDecider",
    "ShiryaevRobertsDecider",
    "StatementMetrics",
    "Statements",
    "ThresholdDecider",
    "Tracks",
    "first_estimate",
    "measure_statements",
    "record_statements",
    "sprt_test",
    "sprt_thresholds",
    "track_ate",
]
