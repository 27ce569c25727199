"""Stable-Baselines3's VecEnv on the vector environment: no Python object per track, no Monitor wrapper."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3.common.vec_env.base_vec_env import VecEnv, VecEnvIndices

from hybrid_env.registration import make_vector_env


class HybridTrackVecEnv(VecEnv):
    """N tracks for Stable-Baselines3, with episode statistics under `info["episode"]`.

    Args:
        env_id: registered id.
        num_envs: N.
        options: of the world, over those of the id.
    """

    def __init__(self, env_id: str = "hybrid_env:HybridTrack-v0", num_envs: int = 64, **options: Any):
        self.env = make_vector_env(
            env_id, num_envs, autoreset_mode=AutoresetMode.SAME_STEP, tick_info=False, **options
        )
        self.render_mode = None
        super().__init__(num_envs, self.env.single_observation_space, self.env.single_action_space)
        self._actions = np.zeros(num_envs, np.int64)
        self._returns = np.zeros(num_envs)
        self._steps = np.zeros(num_envs, np.int64)

    def reset(self) -> NDArray[np.float32]:
        """Begin an episode on every track, with the seeds of `seed()` if it was called since the last."""
        observation, _ = self.env.reset(seed=list(self._seeds))
        self._reset_seeds()
        self._returns[:] = 0.0
        self._steps[:] = 0
        return observation

    def step_async(self, actions: NDArray[np.int64]) -> None:
        """Take the actions of the next `step_wait`, (N,)."""
        self._actions = actions

    def step_wait(
        self,
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """One step; the row of a terminated track is already the first of its next episode."""
        observation, rewards, terminated, _, info = self.env.step(self._actions)
        self._returns += rewards
        self._steps += 1
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for i in np.flatnonzero(terminated):
            infos[i] = {
                "terminal_observation": info["final_obs"][i],
                "TimeLimit.truncated": False,
                "episode": {"r": float(self._returns[i]), "l": int(self._steps[i])},
            }
        self._returns[terminated] = 0.0
        self._steps[terminated] = 0
        return observation, rewards.astype(np.float32), terminated, infos

    def close(self) -> None:
        """Nothing is held outside memory."""

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """The attribute of the one vector environment, once for each index."""
        return [getattr(self.env, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Tracks share one environment, so an attribute cannot differ between them."""
        raise NotImplementedError("options are fixed when the environment is made: make a new one")

    def env_method(
        self, method_name: str, *method_args: Any, indices: VecEnvIndices = None, **method_kwargs: Any
    ) -> list[Any]:
        """Tracks have no methods of their own."""
        raise NotImplementedError("tracks share one environment and have no methods of their own")

    def env_is_wrapped(self, wrapper_class: Any, indices: VecEnvIndices = None) -> list[bool]:
        """No track is wrapped."""
        return [False for _ in self._get_indices(indices)]

    def get_images(self) -> Sequence[NDArray[np.uint8] | None]:
        """There is no picture of many tracks: render one `HybridTrackEnv`."""
        return [None] * self.num_envs
