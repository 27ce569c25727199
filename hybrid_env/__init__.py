"""HybridTrack: decide quickly and correctly which mode of motion an object has switched to.
Importing this package registers the environments. `gym.make("hybrid_env:HybridTrack-v0")` imports
it. Its names are loaded when they are first used.
"""

from hybrid_env.extras import lazy_names
from hybrid_env.registration import register_environments

__all__, __getattr__, __dir__ = lazy_names(__name__)

register_environments()
