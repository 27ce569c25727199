"""HybridTrack: decide quickly and correctly which mode of motion an object has switched to.

Importing this package registers the environments. `gym.make("hybrid_env:HybridTrack-v0")` imports it. Its
names are loaded when they are first used.
"""

from typing import TYPE_CHECKING

from hybrid_env.lazy_names import lazy_names
from hybrid_env.registration import ENVIRONMENTS as ENVIRONMENTS
from hybrid_env.registration import register_environments

if TYPE_CHECKING:
    from hybrid_env.checks import ArgumentError as ArgumentError
    from hybrid_env.durations import GeometricDurations as GeometricDurations
    from hybrid_env.durations import UniformDurations as UniformDurations
    from hybrid_env.easy_env import HybridTrackEasyEnv as HybridTrackEasyEnv
    from hybrid_env.easy_env import HybridTrackEasyVectorEnv as HybridTrackEasyVectorEnv
    from hybrid_env.env import HybridTrackEnv as HybridTrackEnv
    from hybrid_env.noises import GaussianNoise as GaussianNoise
    from hybrid_env.noises import LevyNoise as LevyNoise
    from hybrid_env.noises import OutlierNoise as OutlierNoise
    from hybrid_env.noises import StudentNoise as StudentNoise
    from hybrid_env.observation import Layout as Layout
    from hybrid_env.observation import QuickestLayout as QuickestLayout
    from hybrid_env.online import KalmanBank as KalmanBank
    from hybrid_env.options import WorldOptions as WorldOptions
    from hybrid_env.quickest_env import HybridTrackQuickestEnv as HybridTrackQuickestEnv
    from hybrid_env.quickest_options import QuickestOptions as QuickestOptions
    from hybrid_env.scheme import FixedScheme as FixedScheme
    from hybrid_env.scheme import RandomScheme as RandomScheme
    from hybrid_env.scheme import Segment as Segment
    from hybrid_env.scheme import parse_scheme as parse_scheme
    from hybrid_env.sensors import Sensor as Sensor
    from hybrid_env.vector_env import HybridTrackQuickestVectorEnv as HybridTrackQuickestVectorEnv
    from hybrid_env.vector_env import HybridTrackVectorEnv as HybridTrackVectorEnv
else:
    __all__, __getattr__, __dir__ = lazy_names(
        __name__,
        {
            "checks": "ArgumentError",
            "durations": "GeometricDurations UniformDurations",
            "easy_env": "HybridTrackEasyEnv HybridTrackEasyVectorEnv",
            "env": "HybridTrackEnv",
            "noises": "GaussianNoise LevyNoise OutlierNoise StudentNoise",
            "observation": "Layout QuickestLayout",
            "online": "KalmanBank",
            "options": "WorldOptions",
            "quickest_env": "HybridTrackQuickestEnv",
            "quickest_options": "QuickestOptions",
            "scheme": "FixedScheme RandomScheme Segment parse_scheme",
            "sensors": "Sensor",
            "vector_env": "HybridTrackQuickestVectorEnv HybridTrackVectorEnv",
        },
    )

register_environments()
