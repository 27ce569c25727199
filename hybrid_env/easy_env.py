"""HybridTrack for beginners: a declaration counts once the evidence for a mode is strong."""

import operator
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_env.checks import BoolArray, IntArray
from hybrid_env.env import HybridTrackEnv
from hybrid_env.vector_env import HybridTrackVectorEnv, Step
from hybrid_env.world import World

EVIDENCE = 0.95  # posterior probability of a mode above which a declaration counts


class HybridTrackEasyEnv(HybridTrackEnv):
    """HybridTrack for the default settings of learning libraries: a declaration that comes too early waits.

    As long as no mode has a posterior probability above 0.95 (equal priors), every action is the action to wait. What
    counts as a mode is what must be correct: a hypothesis, or with `correctness="type"` straight, left or right. All
    else is that of `HybridTrackEnv`: rewards compare with those of `HybridTrack-v0`, where a policy earns the same if
    it waits in these ticks.

    A fresh policy of most libraries declares three times in four. In `HybridTrack-v0` it ends every segment after a
    tick or two, where waiting costs and shows nothing, and it learns to declare at once. Here every declaration counts
    where the likeliest mode is usually right. A policy that names it there is the MSPRT at an error of 0.05, which
    earns 0.46 per segment with the default options, as ATE does there. More can be earned in `HybridTrack-v0` itself,
    by reading more than the posterior of the bank.
    """

    def step(self, action: Any) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """See `HybridTrackEnv.step`; waits if it is too early for a declaration."""
        index = action
        with suppress(TypeError):  # what is no integer is refused below
            index = operator.index(action)
        if self._started and isinstance(index, int) and index in self.action_space and too_early(self.world)[0]:
            index = 0
        return super().step(index)


class HybridTrackEasyVectorEnv(HybridTrackVectorEnv):
    """A vector environment of N `HybridTrackEasyEnv` tracks, see `HybridTrackVectorEnv`."""

    def step(self, actions: IntArray) -> Step:
        """See `HybridTrackVectorEnv.step`; a track waits if it is too early for a declaration."""
        actions = self.action_array(actions)
        if self._started:
            valid = (actions >= 0) & (actions < self.world.options.action_count)  # others are refused
            actions = np.where(valid & too_early(self.world), 0, actions)
        return super().step(actions)


def too_early(world: World) -> BoolArray:
    """Return whether no mode has a posterior probability above `EVIDENCE`, (N,)."""
    posterior = np.exp(world.layout.read(world.observations, "log_ratio"), dtype=np.float64)
    posterior /= posterior.sum(1, keepdims=True)
    if world.options.correctness == "type":
        one_side = posterior.shape[1] // 2
        left, right = posterior[:, 1 : one_side + 1].sum(1), posterior[:, one_side + 1 :].sum(1)
        posterior = np.stack([posterior[:, 0], left, right], 1)
    return np.asarray(posterior.max(1) <= EVIDENCE)
