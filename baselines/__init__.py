"""Classical deciders: Wald's test and ATE around it, tests between all hypotheses, a fixed decision time."""

from pathlib import Path

import hybrid_env
from baselines.ate import Tracks, first_estimate, track
from baselines.decider import Decider
from baselines.fixed_time import FixedTimeDecider
from baselines.msprt import GapDecider, MSPRTDecider
from baselines.sprt import SPRTDecider, sprt_test, sprt_thresholds
from hybrid_env.compile_cache import drop_stale_cache

drop_stale_cache(sprt_test.stats.cache_path, [Path(__file__).parent, Path(hybrid_env.__file__).parent])

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
