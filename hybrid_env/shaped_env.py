"""HybridTrack with a shaped reward: the environment of one track and the vector environment."""

from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from hybrid_env.env import HybridTrackEnv
from hybrid_env.vector_env import HybridTrackVectorEnv
from hybrid_env.world import World


class HybridTrackShapedEnv(HybridTrackEnv):
    """HybridTrack for the default settings of learning libraries: its reward is shaped by a potential.

    The reward of a step is that of `HybridTrackEnv` plus Phi(s') - Phi(s), where Phi is the posterior
    probability of the most likely hypothesis (equal priors) and 0 once the episode has ended. The sum over an
    episode is that of `HybridTrackEnv` less Phi of its first tick, which no policy changes. So every policy
    has the same rank, and the best policy is the same (Ng, Harada and Russell 1999, theorem 1, with a
    discount factor of 1).

    Without shaping, a fresh policy learns to declare at once: waiting costs now, and what it is good for is
    paid many ticks later, which a random policy never sees. Here a declaration earns on average minus the
    probability that it is wrong, at once, and waiting earns the growth of the posterior.

    Actions, observations, info and options are those of `HybridTrackEnv`. Report rewards of
    `HybridTrack-v0`, where the same policies run.

    ## References
    Ng, Harada and Russell 1999: Policy invariance under reward transformations. ICML.
    """

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """See `HybridTrackEnv.reset`."""
        observation, info = super().reset(seed=seed, options=options)
        self._potential = potential(self.world)
        return observation, info

    def step(self, action: Any) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """See `HybridTrackEnv.step`; the reward is shaped."""
        observation, reward, terminated, truncated, info = super().step(action)
        before, self._potential = self._potential, potential(self.world)
        after = 0.0 if terminated else self._potential.item(0)
        return observation, reward + after - before.item(0), terminated, truncated, info


class HybridTrackShapedVectorEnv(HybridTrackVectorEnv):
    """A vector environment of N `HybridTrackShapedEnv` tracks, see `HybridTrackVectorEnv`."""

    def reset(
        self, *, seed: Any = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """See `HybridTrackVectorEnv.reset`."""
        observation, info = super().reset(seed=seed, options=options)
        self._potential, self._ended = potential(self.world), np.zeros(self.num_envs, np.bool_)
        return observation, info

    def step(
        self, actions: NDArray[np.int64]
    ) -> tuple[
        NDArray[np.float32], NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]
    ]:
        """See `HybridTrackVectorEnv.step`; the rewards are shaped."""
        observation, rewards, terminated, truncated, info = super().step(actions)
        before, self._potential = self._potential, potential(self.world)
        gained = np.where(terminated, 0.0, self._potential) - before
        rewards += np.where(self._ended, 0.0, gained)  # the step that resets a track has no reward
        if self.autoreset_mode is AutoresetMode.NEXT_STEP:
            self._ended = terminated
        return observation, rewards, terminated, truncated, info


def potential(world: World) -> NDArray[np.float64]:
    """Return the posterior probability of the most likely hypothesis of every track, (N,)."""
    return -np.expm1(world.layout.read(world.observations, "log_error_probability").astype(np.float64))
