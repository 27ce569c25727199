"""VecEnv of Stable-Baselines3 whose observation is the belief state of a sequence agent."""

from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from torch import Tensor

from agents.learned.sequence import SequenceNet, check_declares_hypotheses
from agents.learned.stopping import BeliefEncoder
from agents.training.vec_env import HybridTrackVecEnv


class StoppingVecEnv(HybridTrackVecEnv):
    """N parallel tracks observed through the belief state of a sequence agent; action 1 declares its best.

    Args:
        net: trained sequence network.
        env_id, num_envs, options: see `HybridTrackVecEnv`; the option `actions` must be "all".
    """

    def __init__(self, net: SequenceNet, env_id: str, num_envs: int, **options: Any):
        super().__init__(env_id, num_envs, **options)
        check_declares_hypotheses(self.env.options)
        self._encoder = BeliefEncoder(net, self.env.options.correctness == "type")
        self.observation_space = spaces.Box(-np.inf, np.inf, (self._encoder.width,), np.float32)
        self.action_space = spaces.Discrete(2)
        self._hidden_state: Tensor | None = None
        self._rows = np.zeros((num_envs, self._encoder.width), np.float32)
        self._best = np.zeros(num_envs, np.int64)

    def reset(self) -> NDArray[np.float32]:
        """Start a new episode on every track; return belief rows (N, width)."""
        return self._encode(super().reset())

    def step_async(self, actions: NDArray[np.int64]) -> None:
        """Set the actions (N,) of the next `step_wait`: 0 waits, 1 declares."""
        super().step_async(np.where(actions == 1, self._best + 1, 0))

    def step_wait(
        self,
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Step all tracks. A terminal observation is the belief row at the last declaration."""
        observation, rewards, terminated, infos = super().step_wait()
        for i in np.flatnonzero(terminated):
            infos[i]["terminal_observation"] = self._rows[i]
        return self._encode(observation), rewards, terminated, infos

    def state_arrays(self) -> dict[str, NDArray[Any]]:
        """See `HybridTrackVecEnv.state_arrays`. Requires an earlier reset."""
        assert self._hidden_state is not None
        # without `_rows`, which is the array that the last reset or step returned
        return super().state_arrays() | {"best": self._best, "hidden_state": self._hidden_state.numpy()}

    def _encode(self, observation: NDArray[np.float32]) -> NDArray[np.float32]:
        encoded = self._encoder.encode(observation, self._hidden_state)
        self._rows, self._best, self._hidden_state = encoded
        return self._rows
