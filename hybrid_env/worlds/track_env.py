"""The environment of one track, common to all environments."""

import functools
import operator
from typing import Any, ClassVar

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from hybrid_env.checks import ReadOnlyAttributes, check_choice, check_integer, check_reset_options
from hybrid_env.rendering.evidence import EvidencePanel
from hybrid_env.rendering.history import History
from hybrid_env.rendering.renderer import Renderer
from hybrid_env.rendering.window import RENDER_FPS
from hybrid_env.seeding import state_of
from hybrid_env.worlds.tracks import Tracks


class TrackEnv(ReadOnlyAttributes, gym.Env[NDArray[np.float32], np.int64]):
    """An environment of one track; each environment has a subclass that names its options and arrays.

    Args:
        render_mode: "human", "rgb_array" or None.
        options: of the model.

    Raises:
        ArgumentError: an argument has a value that is not allowed.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": ["human", "rgb_array"], "render_fps": RENDER_FPS}  # type: ignore[misc]

    read_only = frozenset(("options", "world"))

    options_class: ClassVar[Any]
    """Class of the options."""

    history: History | None
    """Ticks of the running episode, for rendering; None without a render mode."""
    renderer: Renderer | None
    """Draws the history; None without a render mode."""

    def __init__(self, render_mode: str | None = None, **options: Any):
        if render_mode is not None:
            check_choice("render_mode", render_mode, self.metadata["render_modes"])
        self.render_mode = render_mode
        self.options = self.options_class.of(**options)
        self.history = self.renderer = None
        self.world = self._create_world(rendered=render_mode is not None)
        if render_mode is not None:
            self.history = History()
            self.renderer = Renderer(self.options, render_mode == "human", self._evidence_panel())
        self.action_space = self.world.action_space()
        self.observation_space = self.world.observation_space()  # type: ignore[assignment]

        self._reset_mask = np.ones(1, np.bool_)
        self._action_count = int(self.action_space.n)
        self._started = False
        self._bind_views()

    def _create_world(self, rendered: bool) -> Tracks:
        """Return the arrays of one track."""
        raise NotImplementedError

    def _evidence_panel(self) -> EvidencePanel:
        """Return what the evidence panel of a frame shows."""
        raise NotImplementedError

    def _step_info(self, events: int) -> dict[str, Any]:
        """Return further info of the last step, by the events of the kernel."""
        return {}

    def _record(self, history: History, info: dict[str, Any], finished: bool) -> None:
        """Add the last step or reset to the history."""
        raise NotImplementedError

    def _bind_views(self) -> None:
        """Create views of the single track once, because creating them takes longer than a tick."""
        self._actions = self.world.actions
        self._observation = self.world.observations[0]
        self._reward, self._terminated = self.world.rewards, self.world.terminated
        block, field = self.world.blocks[0], self.world.hypothesis_field
        views = {name: block[name][..., 0] for name in self.world.tick_names}
        views[field] = self.world.bank.hypotheses[field][0, :, 0]
        # NumPy scalars, because libraries read the dtype of every value
        self._info_readers = [
            (name, view.copy if view.ndim else functools.partial(view.__getitem__, ()))
            for name, view in views.items()
        ]
        self._info_names: dict[str, Any] = dict.fromkeys(views)

    def _info(self) -> dict[str, Any]:
        """Return the info of the current tick: NumPy scalars, and copies of arrays."""
        info = self._info_names.copy()  # a dictionary of the final size is filled faster
        for name, read in self._info_readers:
            info[name] = read()
        return info

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._bind_views()  # copied and unpickled views do not share memory with the world

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin an episode. Without a seed the random stream continues. `options` is not used.

        Raises:
            ArgumentError: the seed is not an integer >= 0 or None, or `options` not a dict or None.
        """
        check_reset_options(options)
        super().reset(seed=None if seed is None else check_integer("seed", seed, minimum=0))
        if seed is not None or not self.world.seeded[0]:
            self.world.seed(0, state_of(self.np_random))
        self.world.reset(self._reset_mask)
        self._started = True
        info = self._info()
        if self.history is not None:
            self.history.begin()
            self._record(self.history, info, finished=False)
            if self.render_mode == "human":
                self.render()
        return self._observation.copy(), info

    def step(self, action: Any) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Apply an action of the action space and advance the track.

        Raises:
            InvalidAction: the action is outside the space. The track is not stepped.
            ResetNeeded: no episode is running.
        """
        try:
            index = operator.index(action)
        except TypeError:
            raise self.world.invalid_action(action) from None
        if not 0 <= index < self._action_count:
            raise self.world.invalid_action(action)
        if not self._started or self._terminated.item(0):
            raise gym.error.ResetNeeded("step() requires a running episode: call reset() first")
        self._actions[0] = index
        events = self.world.step()
        info = self._info()
        if events:
            info |= self._step_info(events)
        if self.history is not None:
            self._record(self.history, info, self._terminated.item(0))
            if self.render_mode == "human":
                self.render()
        return self._observation.copy(), self._reward.item(0), self._terminated.item(0), False, info

    def render(self) -> Any:
        """Render the episode so far: returns a (height, width, 3) uint8 frame in the mode "rgb_array"."""
        if self.history is None or self.renderer is None:
            gym.logger.warn(
                "render() has no effect without a render_mode: create the environment with "
                "render_mode='rgb_array' or 'human'"
            )
            return None
        if not self._started:
            raise gym.error.ResetNeeded("render() requires a running episode: call reset() first")
        return self.renderer.draw(self.history)

    def close(self) -> None:
        """Close the window if one is open."""
        if self.renderer is not None:
            self.renderer.close()
