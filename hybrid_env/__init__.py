"""HybridTrack: decide quickly and correctly which mode of motion an object has switched to.

Importing this package registers the environments. `gym.make("hybrid_env:HybridTrack-v0")` imports it.
"""

from hybrid_env.checks import ArgumentError
from hybrid_env.easy_env import HybridTrackEasyEnv, HybridTrackEasyVectorEnv
from hybrid_env.env import HybridTrackEnv
from hybrid_env.observation import Layout, QuickestLayout
from hybrid_env.online import KalmanBank
from hybrid_env.options import WorldOptions
from hybrid_env.quickest_env import HybridTrackQuickestEnv
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.registration import ENVIRONMENTS, register_environments
from hybrid_env.scheme import SCHEMES, FixedScheme, RandomScheme, Segment, parse_scheme
from hybrid_env.sensors import Sensor
from hybrid_env.vector_env import HybridTrackQuickestVectorEnv, HybridTrackVectorEnv

__all__ = [
    "ENVIRONMENTS",
    "SCHEMES",
    "ArgumentError",
    "FixedScheme",
    "HybridTrackEasyEnv",
    "HybridTrackEasyVectorEnv",
    "HybridTrackEnv",
    "HybridTrackQuickestEnv",
    "HybridTrackQuickestVectorEnv",
    "HybridTrackVectorEnv",
    "KalmanBank",
    "Layout",
    "QuickestLayout",
    "QuickestOptions",
    "RandomScheme",
    "Segment",
    "Sensor",
    "WorldOptions",
    "parse_scheme",
]

register_environments()
