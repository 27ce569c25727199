"""Classical deciders: Wald's test and ATE around it, tests between all hypotheses, a fixed decision time."""

from pathlib import Path

import hybrid_env
from baselines.deciders.decider import Decider
from baselines.deciders.fixed_time import FixedTimeDecider
from baselines.deciders.msprt import GapDecider, MSPRTDecider
from baselines.deciders.sprt import SPRTDecider, sprt_test, sprt_thresholds
from baselines.filters.recording import first_estimate
from baselines.recordings.ate import Tracks, track
from hybrid_env.core.compile_cache import drop_stale_cache

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
