"""A wrapper for recorders that need the same keys in `info` at every step."""

from typing import Any

import gymnasium as gym
import numpy as np

from hybrid_env.checks import Info, OwnState
from hybrid_env.env import HybridTrackEnv

NO_DECISION: Info = {
    "decided_mode": np.int64(-1),
    "decided_true_mode": np.int64(-1),
    "correct": np.array(False),
    "type_correct": np.array(False),
    "ticks": np.int64(0),
    "forced": np.array(False),
    "decided_length": np.int64(0),
    "decided_squared_error": np.float64(0.0),
}
"""What `info` tells of a decision in a step without one."""


class CompleteInfo(OwnState, gym.Wrapper[Any, Any, Any, Any], gym.utils.RecordConstructorArgs):
    """Adds `NO_DECISION` to the `info` of `HybridTrackEnv` in steps without a decision, and NaN for
    what a tick without a measurement leaves out: recorders such as Minari's `DataCollector(env,
    record_infos=True)` need the same structure at every step.
    """

    def __init__(self, env: gym.Env[Any, Any]):
        # Makes the wrapper part of `spec`, by which data sets make their environment.
        gym.utils.RecordConstructorArgs.__init__(self)
        super().__init__(env)
        base: Any = env.unwrapped
        nothing = np.full((base.options.hypotheses, 2), np.nan)
        self._added: Info = {"measurement": nothing[0]}
        if base.bank_info:
            self._added["innovations"] = nothing
        if isinstance(base, HybridTrackEnv):
            self._added |= NO_DECISION

    def reset(self, **keywords: Any) -> tuple[Any, Info]:
        """See `gymnasium.Env.reset`."""
        observation, info = self.env.reset(**keywords)
        return observation, self._added | info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, Info]:
        """See `gymnasium.Env.step`."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        return observation, reward, terminated, truncated, self._added | info
