"""VecEnv of Stable-Baselines3 on the vector environment, without one Python object or Monitor
per track.
"""

from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3.common.vec_env.base_vec_env import VecEnv, VecEnvIndices

from hybrid_env.checks import BoolArray, Float32Array, IntArray
from hybrid_env.registration import make_track_vector_env


def as_vec_env(
    env_id: str = "hybrid_env:HybridTrack-v0", num_envs: int = 64, **options: Any
) -> "HybridTrackVecEnv":
    """Return N tracks of a registered id as a VecEnv of Stable-Baselines3, stepped in one call.

    >>> vec_env = as_vec_env("hybrid_env:HybridTrack-v0", 64)
    >>> vec_env.reset().shape
    (64, 29)

    Args:
        env_id: registered id.
        num_envs: N, number of tracks.
        options: of the environment, which override those of the id.

    Raises:
        ArgumentError: an argument is not allowed.
    """
    return HybridTrackVecEnv(env_id, num_envs, **options)


class HybridTrackVecEnv(VecEnv):
    """N = `num_envs` parallel tracks as a VecEnv, with episode statistics in `info["episode"]`.

    The options override those of the registered id; `reward_scale` is a factor of the rewards, not
    of the statistics.
    """

    def __init__(self, env_id: str, num_envs: int, reward_scale: float = 1.0, **options: Any):
        self.env = make_track_vector_env(
            env_id, num_envs, autoreset_mode=AutoresetMode.SAME_STEP, tick_info=False, **options
        )
        self.render_mode, self.reward_scale = None, reward_scale
        super().__init__(num_envs, self.env.single_observation_space, self.env.single_action_space)
        self._returns, self._steps = np.zeros(num_envs), np.zeros(num_envs, np.int64)

    def reset(self) -> Float32Array:
        """Start a new episode on every track, seeded if `seed()` was called since the last
        reset.
        """
        observation, _ = self.env.reset(seed=list(self._seeds))
        self._reset_seeds()
        self._returns[:] = self._steps[:] = 0
        return observation

    def step_async(self, actions: IntArray) -> None:
        """Set the actions (N,) of the next `step_wait`."""
        self._actions = actions

    def step_wait(self) -> tuple[Float32Array, Float32Array, BoolArray, list[dict[str, Any]]]:
        """Step all tracks. Terminated tracks are reset and return the first row of the next
        episode.
        """
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
        self._returns[terminated] = self._steps[terminated] = 0
        return observation, (self.reward_scale * rewards).astype(np.float32), terminated, infos

    def state_arrays(self) -> dict[str, NDArray[Any]]:
        """Return all arrays that determine the next steps; writing into them changes the tracks."""
        world = self.env.world
        arrays = {
            "observations": world.observations,
            "terminated": world.terminated,
            "returns": self._returns,
            "steps": self._steps,
        }
        for name, records in ({"blocks": world.blocks} | world.bank._asdict()).items():
            arrays |= {f"{name}.{field}": records[field] for field in records.dtype.names or ()}
        return arrays

    def close(self) -> None:
        """Do nothing; no external resources are held."""

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """Return the attribute of the vector environment, once per index."""
        return [getattr(self.env, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Not supported: the tracks share one environment."""
        raise NotImplementedError(
            "options are fixed when the environment is created: create a new one"
        )

    def env_method(
        self,
        method_name: str,
        *method_args: Any,
        indices: VecEnvIndices = None,
        **method_kwargs: Any,
    ) -> list[Any]:
        """Return one result per index of `action_masks`; other methods raise
        `NotImplementedError`.
        """
        if method_name == "action_masks":
            return list(self.env.action_masks()[list(self._get_indices(indices))])
        raise NotImplementedError("the tracks share one environment and have no individual methods")

    def env_is_wrapped(self, wrapper_class: Any, indices: VecEnvIndices = None) -> list[bool]:
        """Return False for each index; tracks are not wrapped."""
        return [False for _ in self._get_indices(indices)]
