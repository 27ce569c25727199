"""HybridTrack: decide soon and rightly which mode of motion an object has switched to.

Importing this package registers the environments; `gym.make("hybrid_env:HybridTrack-v0")` imports it too.
"""

from pathlib import Path

from gymnasium.envs.registration import register, registry

from hybrid_env.compile_cache import drop_stale_cache
from hybrid_env.env import HybridTrackEnv
from hybrid_env.kalman_bank import KalmanBank
from hybrid_env.kernel import advance_tracks
from hybrid_env.observation import Layout
from hybrid_env.options import WorldOptions
from hybrid_env.scheme import SCHEMES, FixedScheme, RandomScheme, Segment, parse_scheme
from hybrid_env.vector_env import HybridTrackVectorEnv

__all__ = [
    "SCHEMES",
    "FixedScheme",
    "HybridTrackEnv",
    "HybridTrackVectorEnv",
    "KalmanBank",
    "Layout",
    "RandomScheme",
    "Segment",
    "WorldOptions",
    "parse_scheme",
]

drop_stale_cache(advance_tracks.stats.cache_path, [Path(__file__).parent])

ENVIRONMENTS: dict[str, dict[str, object]] = {
    "HybridTrack-v0": {},
    "HybridTrackBank-v0": {
        "radii": tuple(float(radius) for radius in range(1, 11)),
        "correctness": "type",
        "delay_cost": 0.01,
    },
}
"""Registered ids and the options in which they differ from the defaults."""

for _id, _options in ENVIRONMENTS.items():
    if _id not in registry:
        register(
            id=_id,
            entry_point="hybrid_env.env:HybridTrackEnv",
            vector_entry_point="hybrid_env.vector_env:HybridTrackVectorEnv",
            kwargs=_options,
        )
