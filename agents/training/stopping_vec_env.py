"""Tracks whose observation is what a sequence agent believes, for training with Stable-Baselines3."""

from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from torch import Tensor

from agents.learned.sequence import SequenceNet, check_declares_hypotheses
from agents.learned.stopping import Beliefs
from agents.training.vec_env import HybridTrackVecEnv


class StoppingVecEnv(HybridTrackVecEnv):
    """N tracks whose observation is what a sequence agent believes; action 1 declares its best hypothesis.

    Args:
        net: trained.
        env_id, num_envs, options: as of `HybridTrackVecEnv`, with every hypothesis to be declared.
    """

    def __init__(self, net: SequenceNet, env_id: str, num_envs: int, **options: Any):
        super().__init__(env_id, num_envs, **options)
        check_declares_hypotheses(self.env.options)
        self._beliefs = Beliefs(net, self.env.options.correctness == "type")
        self.observation_space = spaces.Box(-np.inf, np.inf, (self._beliefs.width,), np.float32)
        self.action_space = spaces.Discrete(2)
        self._memory: Tensor | None = None
        self._rows = np.zeros((num_envs, self._beliefs.width), np.float32)
        self._best = np.zeros(num_envs, np.int64)

    def reset(self) -> NDArray[np.float32]:
        """Begin an episode on every track."""
        return self._read(super().reset())

    def step_async(self, actions: NDArray[np.int64]) -> None:
        """Take the actions of the next `step_wait`, (N,): 0 waits, 1 declares."""
        super().step_async(np.where(actions == 1, self._best + 1, 0))

    def step_wait(
        self,
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """One step; the last row of a terminated track is the one that it declared on."""
        observation, rewards, terminated, infos = super().step_wait()
        for i in np.flatnonzero(terminated):
            infos[i]["terminal_observation"] = self._rows[i]
        return self._read(observation), rewards, terminated, infos

    def _read(self, observation: NDArray[np.float32]) -> NDArray[np.float32]:
        self._rows, self._best, self._memory = self._beliefs.read(observation, self._memory)
        return self._rows
