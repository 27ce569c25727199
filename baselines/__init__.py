"""Classical decision rules: Wald's SPRT, MSPRT and gap rule, fixed decision time; ATE on recordings.

For unknown switch moments: a threshold, CUSUM, Shiryaev-Roberts, the windowed generalized likelihood ratio,
the detector of Golubkov 2020 and a beam of histories.
`OnlineTracker` puts a rule behind a live sensor.
"""

from baselines.recordings.arrays import first_estimate
from baselines.recordings.ate import Tracks, track_ate
from baselines.rules.beam import BeamDecider
from baselines.rules.change_detection import CusumDecider, ShiryaevRobertsDecider
from baselines.rules.decider import Decider
from baselines.rules.fixed_time import FixedTimeDecider
from baselines.rules.msprt import GapDecider, MSPRTDecider
from baselines.rules.restarted import GLRDecider, MeanRatioDecider
from baselines.rules.rollout import record_statements
from baselines.rules.sprt import SPRTDecider, sprt_test, sprt_thresholds
from baselines.rules.threshold import ThresholdDecider
from baselines.rules.tracker import OnlineEstimate, OnlineTracker
from baselines.scoring.score import TimelineScores, score
from baselines.scoring.statements import StatementMetrics, Statements, measure_statements

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
    "TimelineScores",
    "Tracks",
    "first_estimate",
    "measure_statements",
    "record_statements",
    "score",
    "sprt_test",
    "sprt_thresholds",
    "track_ate",
]
