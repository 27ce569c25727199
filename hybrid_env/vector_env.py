"""The vector environments: N tracks in one kernel call."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_env.core.records import DECISION, DECISION_FLAGS
from hybrid_env.options import WorldOptions
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.worlds.quickest_world import QuickestWorld
from hybrid_env.worlds.track_vector_env import TrackVectorEnv
from hybrid_env.worlds.world import World

_DECISION_MASKS = tuple(f"_{key}" for key in DECISION + DECISION_FLAGS if key != "has_decision")


class HybridTrackVectorEnv(TrackVectorEnv):
    """A vector environment of N `HybridTrackEnv` tracks, stepped in one kernel call.

    With seed s, track i equals the single environment with seed s + i, bit for bit and across autoresets.
    Spaces, rewards and info keys are those of `HybridTrackEnv`, batched. As in Gymnasium, a mask `_key` marks
    the tracks for which an info key is valid.

    Args:
        num_envs: N, number of tracks.
        autoreset_mode: NEXT_STEP resets a terminated track in the next step, whose action is ignored and
            whose reward is 0; SAME_STEP resets it in the same step and returns `final_obs` and `final_info`;
            DISABLED requires a call of `reset(options={"reset_mask": ...})`.
        tick_info: False omits the description of the current tick from the info of `step`, which is faster
            for training. Decisions, `final_obs` and `final_info` are always present.
        trace_rows: number of ticks per step stored in `world.trace`, 0 to store none.
        threads: number of threads that step the tracks in parallel. Results do not depend on it. More than
            one is useful from about 4,000 tracks.
        options: see `WorldOptions`.

    Raises:
        ArgumentError: an argument has a value that is not allowed.
    """

    options_class, tracks_class = WorldOptions, World

    options: WorldOptions
    world: World

    def _decision_info(self, mask: NDArray[np.bool_] | None = None) -> dict[str, Any]:
        """Return the info of the decisions of the last step, zero for tracks outside a mask, (N,)."""
        values = self.world.read_decisions()
        decided = values.pop("has_decision")
        if mask is not None:
            for array in values.values():
                array[~mask] = 0
            decided &= mask
        elif self._same_step and not decided.any():
            return {}  # the decisions are in `final_info`
        return values | dict.fromkeys(_DECISION_MASKS, decided)


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
