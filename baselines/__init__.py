"""Classical decision rules: Wald's SPRT, MSPRT and gap rule, fixed decision time; ATE on recordings.

For unknown switch moments: a threshold, CUSUM, Shiryaev-Roberts, the windowed generalized likelihood ratio,
the detector of Golubkov 2020 and a beam of histories.
`OnlineTracker` puts a rule behind a live sensor. Names are loaded when they are first used.
"""

from typing import TYPE_CHECKING

from hybrid_env.lazy_names import lazy_names

if TYPE_CHECKING:
    from baselines.estimation.imm import IMMFilter as IMMFilter
    from baselines.recordings.ate import track_ate as track_ate
    from baselines.recordings.reading.read import read_recordings as read_recordings
    from baselines.rules.beam import BeamDecider as BeamDecider
    from baselines.rules.change_detection import CusumDecider as CusumDecider
    from baselines.rules.change_detection import ShiryaevRobertsDecider as ShiryaevRobertsDecider
    from baselines.rules.decider import Decider as Decider
    from baselines.rules.fixed_time import FixedTimeDecider as FixedTimeDecider
    from baselines.rules.msprt import GapDecider as GapDecider
    from baselines.rules.msprt import MSPRTDecider as MSPRTDecider
    from baselines.rules.restarted import GLRDecider as GLRDecider
    from baselines.rules.restarted import MeanRatioDecider as MeanRatioDecider
    from baselines.rules.rollout import record_statements as record_statements
    from baselines.rules.sprt import SPRTDecider as SPRTDecider
    from baselines.rules.sprt import sprt_thresholds as sprt_thresholds
    from baselines.rules.threshold import ThresholdDecider as ThresholdDecider
    from baselines.rules.tracker import OnlineEstimate as OnlineEstimate
    from baselines.rules.tracker import OnlineTracker as OnlineTracker
    from baselines.scoring.score import TimelineScores as TimelineScores
    from baselines.scoring.score import score as score
    from baselines.scoring.statements import Statements as Statements
    from baselines.scoring.statements import measure_statements as measure_statements
else:
    __all__, __getattr__, __dir__ = lazy_names(
        __name__,
        {
            "estimation.imm": "IMMFilter",
            "recordings.ate": "track_ate",
            "recordings.reading.read": "read_recordings",
            "rules.beam": "BeamDecider",
            "rules.change_detection": "CusumDecider ShiryaevRobertsDecider",
            "rules.decider": "Decider",
            "rules.fixed_time": "FixedTimeDecider",
            "rules.msprt": "GapDecider MSPRTDecider",
            "rules.restarted": "GLRDecider MeanRatioDecider",
            "rules.rollout": "record_statements",
            "rules.sprt": "SPRTDecider sprt_thresholds",
            "rules.threshold": "ThresholdDecider",
            "rules.tracker": "OnlineEstimate OnlineTracker",
            "scoring.score": "TimelineScores score",
            "scoring.statements": "Statements measure_statements",
        },
    )
