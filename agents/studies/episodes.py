"""Episodes of a decider on one track: played for a window or an animation, or recorded for a figure."""

from collections.abc import Callable, Iterator
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from agents.evaluation.cells import filled_table
from agents.evaluation.registry import load_decider
from agents.evaluation.task import Task
from agents.figures.tracks import TrackRecord
from baselines.rules.rollout import rollout
from hybrid_env.env import TrackEnv
from hybrid_env.rendering.history import TRACE_INDEX, History
from hybrid_env.rendering.window import Renderer


class OneTrack:
    """An environment of one track with the interface of a vector environment."""

    num_envs = 1

    def __init__(self, env: TrackEnv):
        self.env, self.world, self.single_action_space = env, env.world, env.action_space

    def reset(self, *, seed: int | None = None) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin an episode."""
        row, info = self.env.reset(seed=seed)
        return row[None], info

    def step(self, actions: NDArray[np.int64]) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Step the track."""
        row, reward, terminated, truncated, info = self.env.step(int(actions[0]))
        return row[None], np.array([reward]), np.array([terminated]), np.array([truncated]), info


class Episodes:
    """Episodes of a decider on one track; `decider` replaces that of the name, and needs `changes` of the options."""

    def __init__(self, task: Task, name: str, decider: Any = None, changes: Any = None):
        self.task, self.name = task.changed(changes or {}), name
        env = gym.make(task.env_id, render_mode="rgb_array", **self.task.given).unwrapped
        assert isinstance(env, TrackEnv)
        self.env, self.decider = env, load_decider(name, env.options) if decider is None else decider

    @property
    def history(self) -> History:
        """The running episode."""
        assert self.env.history is not None
        return self.env.history

    def renderer(self, human: bool) -> Renderer:
        """Return a renderer with the evidence of the decider, of a window if `human`."""
        return Renderer(self.env.options, human, self.decider.panel())

    def play(self, seed: int, on_step: Callable[[], None]) -> Iterator[History]:
        """Play an episode; yield its history before every step, with the evidence of the decider."""
        for now in rollout(OneTrack(self.env), self.decider, seed):
            if now.step:
                on_step()
            if now.terminated[0]:
                return
            self.history.set_evidence(self.decider.evidence(now.seen, now.state, now.starts)[0])
            yield self.history

    def table(self, title: str) -> Table:
        """Return a table of the episode that has just ended."""
        return filled_table(title, *self.task.episode_table(self.history))

    def record(self, name: str, seed: int) -> TrackRecord:
        """Play an episode and return what was declared or stated at every tick, with the name in the figure."""
        for _ in self.play(seed, lambda: None):
            pass
        history = self.history
        truth, measured, estimates = (
            history.trace[:, [TRACE_INDEX[f"{key}x"], TRACE_INDEX[f"{key}y"]]] for key in ("", "measured_", "estimate_")
        )
        return self.task.track_record(
            history, name=name, truth=truth, measurements=measured, true_modes=history.true_modes, estimates=estimates
        )
