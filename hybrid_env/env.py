"""The environment of one track."""

import operator
from typing import Any, ClassVar

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from hybrid_env.checks import check_choice
from hybrid_env.options import WorldOptions
from hybrid_env.rendering import EpisodeHistory, Renderer
from hybrid_env.world import DECISION_INFO, World


class HybridTrackEnv(gym.Env[NDArray[np.float32], np.int64]):
    """DOC"""

    metadata: ClassVar[dict[str, Any]] = {"render_modes": ["human", "rgb_array"], "render_fps": 10}  # type: ignore[misc]

    def __init__(self, render_mode: str | None = None, **options: Any):
        if render_mode is not None:
            check_choice("render_mode", render_mode, self.metadata["render_modes"])
        self.render_mode = render_mode
        self.options = WorldOptions.of(**options)
        self.history: EpisodeHistory | None = None
        rendered = render_mode is not None
        self.world = World(self.options, 1, trace_rows=self.options.longest_segment + 1 if rendered else 0)
        if rendered:
            self.history = EpisodeHistory(self.options)
            self._renderer = Renderer(self.options, human=render_mode == "human")
        self.action_space = self.world.action_space()
        self.observation_space = self.world.observation_space()

        # live views of the one track, so that a step makes no new ones
        tracks = self.world.tracks
        self._track = tracks[0]
        self._all = np.ones(1, np.bool_)
        self._action = np.zeros(1, np.int64)
        self._action_count = self.options.action_count
        self._observation = self.world.observations[0]
        self._rewards = self.world.rewards
        self._log_likelihood = self.world.log_likelihood[0]
        self._segment, self._tick, self._true_mode = tracks["segment"], tracks["tick"], tracks["true_mode"]
        self._truth, self._measurement = tracks["truth"][0], tracks["measurement"][0]
        self._anchor, self._estimate = tracks["anchor"][0], tracks["estimate"][0]
        self._terminated, self._has_decision = tracks["terminated"], tracks["has_decision"]
        self._started = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin an episode. Without a seed the track's random stream goes on; `options` is not used."""
        super().reset(seed=seed)
        if seed is not None or not self.world.seeded[0]:
            self.world.seed(0, self.np_random)
        self.world.reset(self._all)
        self._started = True
        if self.history is not None:
            self.history.begin(self.world.traced(0), self._log_likelihood)
            if self.render_mode == "human":
                self.render()
        return self._observation.copy(), self._info()

    def step(self, action: Any) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Wait one tick (0), or declare a hypothesis and go to the first tick of the next segment."""
        try:
            index = operator.index(action)
        except TypeError:
            raise self.world.invalid_action(action) from None
        if not 0 <= index < self._action_count:
            raise self.world.invalid_action(action)
        if not self._started or self._terminated.item(0):
            raise gym.error.ResetNeeded("step() needs reset() first: no episode is running")
        self._action[0] = index
        self.world.step(self._action)
        info = self._info()
        if self._has_decision.item(0):
            info |= {key: self._track[key].item() for key in DECISION_INFO}
        if self.history is not None:
            self.history.add(self.world.traced(0), self._log_likelihood, info)
            if self.render_mode == "human":
                self.render()
        return self._observation.copy(), self._rewards.item(0), self._terminated.item(0), False, info

    def _info(self) -> dict[str, Any]:
        return {
            "segment": self._segment.item(0),
            "tick": self._tick.item(0),
            "true_mode": self._true_mode.item(0),
            "truth": self._truth.copy(),
            "measurement": self._measurement.copy(),
            "anchor": self._anchor.copy(),
            "estimate": self._estimate.copy(),
            "log_likelihood": self._log_likelihood.copy(),
        }

    def render(self) -> Any:
        """A frame of the episode so far: (height, width, 3) uint8 for "rgb_array", a window for "human"."""
        if self.history is None:
            gym.logger.warn(
                "render() without a render_mode: make the environment with render_mode='rgb_array' or 'human'"
            )
            return None
        if not self._started:
            raise gym.error.ResetNeeded("render() needs reset() first: no episode is running")
        return self._renderer.draw(self.history)

    def close(self) -> None:
        """Close the window, if there is one."""
        if self.history is not None:
            self._renderer.close()
