"""The vector environment with unknown switch moments: N tracks in one kernel call."""

from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.quickest_world import QuickestWorld
from hybrid_env.track_vector_env import TrackVectorEnv


class HybridTrackQuickestVectorEnv(TrackVectorEnv):
    """A vector environment of N `HybridTrackQuickestEnv` tracks, stepped in one kernel call.

    With seed s, track i equals the single environment with seed s + i, bit for bit and across autoresets.
    Spaces, rewards and info keys are those of `HybridTrackQuickestEnv`, batched. As in Gymnasium, a mask
    `_key` marks the tracks for which an info key is valid.

    Args:
        num_envs: N, number of tracks.
        autoreset_mode: as in `HybridTrackVectorEnv`.
        tick_info: False omits the description of the current tick from the info of `step`, which is faster
            for training.
        threads: number of threads that step the tracks in parallel. Results do not depend on it.
        options: see `QuickestOptions`.

    Raises:
        ArgumentError: an argument has a value that is not allowed.
    """

    options_class, tracks_class = QuickestOptions, QuickestWorld

    options: QuickestOptions
    world: QuickestWorld
