"""The vector environments: N tracks in one kernel call."""

from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Integral
from typing import Any, ClassVar

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from hybrid_env.checks import (
    BoolArray,
    FloatArray,
    ReadOnlyAttributes,
    check_choice,
    check_flag,
    check_integer,
    check_reset_options,
    frozen,
    reject,
)
from hybrid_env.core.kernel import TERMINATED
from hybrid_env.core.records import DECISION, DECISION_FLAGS
from hybrid_env.options import WorldOptions
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.rendering.evidence import (
    DEFAULT_ALPHA,
    EvidencePanel,
    probability_panel,
    sprt_panel,
)
from hybrid_env.rendering.history import History, record_declaration, record_statement
from hybrid_env.rendering.window import RENDER_FPS, Renderer
from hybrid_env.world import World, random_states

# Tracks, and rows of a trace.
LARGEST = 2**31 - 1
Step = tuple[NDArray[np.float32], FloatArray, NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]
"""Observations (N, width), rewards, terminated and truncated (N,), and info."""
_DECISION_MASKS = tuple(f"_{key}" for key in DECISION + DECISION_FLAGS if key != "has_decision")
RENDERED = 4
"""Largest number of tracks in a frame, which has two columns."""


@dataclass(frozen=True)
class Scene:
    """A track that is rendered: the ticks of its running episode, and what draws them."""

    history: History
    renderer: Renderer


class TrackVectorEnv(
    ReadOnlyAttributes, VectorEnv[NDArray[np.float32], NDArray[np.int64], NDArray[Any]]
):
    """A vector environment of N tracks, as `HybridTrackVectorEnv`; each environment has a
    subclass with its options.
    """

    options_class: ClassVar[Any]
    evidence_panel: ClassVar[EvidencePanel]
    read_only = frozenset(("num_envs", "options", "world"))

    def __init__(
        self,
        num_envs: int = 1,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        tick_info: bool = False,
        trace_rows: int = 0,
        threads: int = 1,
        bank_info: bool = False,
        render_mode: str | None = None,
        max_episode_steps: int | None = None,
        **options: Any,
    ):
        self.num_envs = check_integer("num_envs", num_envs, maximum=LARGEST)
        try:
            self.autoreset_mode = AutoresetMode(autoreset_mode)
        except ValueError:
            allowed = ", ".join(repr(mode.value) for mode in AutoresetMode)
            raise reject("autoreset_mode", autoreset_mode, allowed) from None
        self.metadata = {
            "render_modes": ["rgb_array"],
            "render_fps": RENDER_FPS,
            "autoreset_mode": self.autoreset_mode,
        }
        if render_mode is not None:
            check_choice("render_mode", render_mode, self.metadata["render_modes"])
        self.render_mode = render_mode
        self.options = self.options_class.of(**options)
        self.options.check_longest(max_episode_steps)
        self.tick_info = check_flag("tick_info", tick_info)
        self.bank_info = check_flag("bank_info", bank_info)
        trace_rows = check_integer("trace_rows", trace_rows, 0, LARGEST)
        if render_mode is not None and self.options.traced:
            trace_rows = max(trace_rows, self.options.longest_segment + 1)
        threads = check_integer("threads", threads, maximum=1024)
        self.world = World(self.options, self.num_envs, trace_rows, threads, self.bank_info)
        rendered = 0 if render_mode is None else min(RENDERED, self.num_envs)
        self._scenes = [
            Scene(History(), Renderer(self.options, human=False, panel=self.evidence_panel))
            for _ in range(rendered)
        ]
        self.single_observation_space = self.world.observation_space()
        self.single_action_space = self.world.action_space()
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._started = False
        self._disabled = self.autoreset_mode is AutoresetMode.DISABLED
        self._same_step = self.autoreset_mode is AutoresetMode.SAME_STEP
        self._shape = (self.num_envs,)
        self._truncated = np.zeros(self.num_envs, np.bool_)
        # Shared by the info of all steps, and therefore read-only.
        self._every_track = frozen(np.ones(self.num_envs, np.bool_))

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin an episode on every track, or on those of `options["reset_mask"]`, (N,) bool.

        Args:
            seed: an integer s seeds track i with s + i; a sequence has one seed per track; None
                continues the random stream of each track.
            options: may contain "reset_mask". A track outside of it that was never reset raises
                `ResetNeeded`.
        """
        mask = np.ones(self.num_envs, np.bool_)
        check_reset_options(options)
        if options is not None and "reset_mask" in options:
            mask = options["reset_mask"]
            if not isinstance(mask, np.ndarray) or (mask.dtype, mask.shape) != (
                np.bool_,
                self._shape,
            ):
                raise reject("reset_mask", mask, f"a bool array of shape ({self.num_envs},)")
            if not mask.any() or np.ma.is_masked(mask):
                raise reject("reset_mask", mask, "at least one True, and no masked element")
            mask = np.array(mask, order="C")
        seeds = self._check_seeds(seed)
        if not (self.world.seeded | mask).all():
            raise gym.error.ResetNeeded(
                "reset() with a reset_mask requires an earlier reset() of all tracks"
            )
        given = np.array([one is not None for one in seeds])
        chosen = np.flatnonzero(mask & (given | ~self.world.seeded))
        if chosen.size:
            self.world.seed(chosen, random_states([seeds[i] for i in chosen.tolist()]))
        self.world.reset(mask)
        self._started = True
        self._record_scenes(mask, mask)
        info = self._tick_info(mask)
        if self.tick_info:
            info |= self._decision_info(np.zeros(self.num_envs, np.bool_))
        return self.world.take_rows(), info

    def _check_seeds(self, seed: Any) -> Sequence[int | None]:
        """Return one seed or None per track."""
        if seed is None:
            return [None] * self.num_envs
        if isinstance(seed, Integral):
            first = check_integer("seed", seed, minimum=0)
            return range(first, first + self.num_envs)
        if isinstance(seed, np.ndarray):
            # A number if it has no dimension.
            seed = seed.tolist()
        if not isinstance(seed, Sequence) or isinstance(seed, str) or len(seed) != self.num_envs:
            raise reject(
                "seed",
                seed,
                f"an integer, or a sequence of {self.num_envs} integers or None",
            )
        return [None if one is None else check_integer("seed", one, minimum=0) for one in seed]

    def action_array(self, actions: Any) -> NDArray[np.int64]:
        """Return actions as an array of integers, (N,). Raises `InvalidAction` if shape or type
        are wrong.
        """
        try:
            array = np.asarray(actions)
        except (TypeError, ValueError, RuntimeError):
            # Ragged, or a tensor with a gradient.
            array = np.array(None)
        if array.shape != self._shape or array.dtype.kind not in "iu":
            found = f"actions have shape {array.shape} and type {array.dtype}"
            raise gym.error.InvalidAction(f"{found}: expected integers of shape ({self.num_envs},)")
        return array

    def step(self, actions: NDArray[np.int64]) -> Step:
        """Step every track. Returns observations, rewards, terminated, truncated and info as
        fresh arrays.

        actions: (N,) integers of the action space; others raise `InvalidAction`, and no track is
        stepped.
        """
        if not self._started:
            raise gym.error.ResetNeeded("step() requires a running episode: call reset() first")
        actions = self.action_array(actions)
        world = self.world
        if self._disabled and world.terminated.any():
            advice = "reset() terminated tracks with a reset_mask first"
            raise gym.error.ResetNeeded(f"step() requires running episodes: {advice}")
        world.actions[:] = actions
        before = world.terminated.copy() if self._scenes else self._truncated
        events = world.step()
        if self._scenes:
            self._record_scenes(self._every_track, before)

        terminated, rewards = world.terminated.copy(), world.rewards.copy()
        final: dict[str, Any] = {}
        if events & TERMINATED and self._same_step:
            final_obs = np.full(self.num_envs, None, dtype=object)
            for i in np.flatnonzero(terminated):
                final_obs[i] = world.observations[i].copy()
            final_info = self._tick_info(terminated) | self._decision_info(terminated)
            final = {"final_obs": final_obs, "final_info": final_info}
            final |= {f"_{key}": terminated.copy() for key in final}
            world.reset(terminated)
            self._record_scenes(terminated, terminated)
        if events or self.tick_info:
            final = self._decision_info() | final
        if self.tick_info or self.bank_info:
            info = self._tick_info()
        else:
            # Most callers train: nothing else is made.
            info = {"action_mask": world.action_mask.copy(), "_action_mask": self._every_track}
        info |= final
        return world.take_rows(), rewards, terminated, self._truncated.copy(), info

    def close_extras(self, **kwargs: Any) -> None:
        """End the threads, if there are any."""
        self.world.close()

    def action_masks(self) -> NDArray[np.bool_]:
        """Return which actions count now, (N, actions)."""
        return np.asarray(self.world.action_mask > 0)

    def render(self) -> Any:
        """Return a frame of the first tracks (at most four), (height, width, 3) uint8; None
        without a render mode.
        """
        if not self._scenes:
            gym.logger.warn(
                "render() has no effect without a render_mode: create it with"
                " render_mode='rgb_array'"
            )
            return None
        if not self._started:
            raise gym.error.ResetNeeded("render() requires a running episode: call reset() first")
        frames = [scene.renderer.draw(scene.history) for scene in self._scenes]
        frames += [np.full_like(frames[0], 255)] * (len(frames) % 2 if len(frames) > 1 else 0)
        rows = [
            np.concatenate(frames[first : first + 2], axis=1) for first in range(0, len(frames), 2)
        ]
        return np.concatenate(rows)

    def _record_scenes(self, stepped: BoolArray, begins: BoolArray) -> None:
        """Add the last step of the tracks that are rendered. stepped, begins: (N,) which of them
        were stepped or reset, and which of these begin an episode.
        """
        if not self._scenes:
            return
        info = self.world.copy_tick()
        decisions = self.world.read_decisions()
        decided = decisions.pop("has_decision")
        for track, scene in enumerate(self._scenes):
            if not stepped[track]:
                continue
            told = info | decisions if decided[track] and not begins[track] else info
            if begins[track]:
                scene.history.begin()
            finished = bool(self.world.terminated[track])
            self._record(
                scene.history,
                track,
                {name: values[track] for name, values in told.items()},
                finished,
            )

    def _record(self, history: History, track: int, info: dict[str, Any], finished: bool) -> None:
        """Add the last step or reset of a track to its history."""
        raise NotImplementedError

    def _tick_info(self, mask: NDArray[np.bool_] | None = None) -> dict[str, Any]:
        """Return the info of the current tick, zero for tracks outside a mask, (N,); all tracks
        without one.
        """
        values: dict[str, Any] = {
            "action_mask": self.world.action_mask.copy(),
            **self.world.bank_tick(),
        }
        if self.tick_info:
            values |= self.world.copy_tick()
        if mask is None:
            mask = self._every_track
        else:
            mask = mask.copy()
            for array in values.values():
                array[~mask] = 0
        return values | {f"_{key}": mask for key in values}

    def _decision_info(self, mask: NDArray[np.bool_] | None = None) -> dict[str, Any]:
        """Return further info of the last step, zero for tracks outside a mask, (N,); by default
        nothing.
        """
        return {}


class HybridTrackVectorEnv(TrackVectorEnv):
    """A vector environment of N `HybridTrackEnv` tracks, stepped in one kernel call.

    With seed s, track i equals the single environment with seed s + i, bit for bit and across
    autoresets. Spaces, rewards and info keys are those of `HybridTrackEnv`, batched. As in
    Gymnasium, a mask `_key` marks the tracks for which an info key is valid.

    Args:
        num_envs: N, number of tracks.
        autoreset_mode: NEXT_STEP resets a terminated track in the next step, whose action is
            ignored and whose reward is 0; SAME_STEP resets it in the same step and returns
            `final_obs` and `final_info`; DISABLED requires a call of `reset(options={"reset_mask":
            ...})`.
        tick_info: True adds the description of the current tick to `info`, with the keys of
            `HybridTrackEnv`, the same ones in every step. Without it `info` has the mask of the
            actions, decisions in the steps that make some, `final_obs` and `final_info`, which
            takes less time.
        trace_rows: number of ticks per step stored in `world.trace`, 0 to store none.
        threads: number of threads that step the tracks in parallel. Results do not depend on it.
            More than one is useful from about 4,000 tracks.
        bank_info: True adds what every filter did, see `HybridTrackEnv`.
        render_mode: "rgb_array" for frames of the first four tracks.
        max_episode_steps: longer options are refused; None and -1 are no limit. `gym.make_vec`
            gives that of the id.
        options: see `WorldOptions`.
    """

    options: WorldOptions
    options_class = WorldOptions
    evidence_panel = sprt_panel(DEFAULT_ALPHA)

    def _record(self, history: History, track: int, info: dict[str, Any], finished: bool) -> None:
        record_declaration(history, self.world.read_trace(track), info, finished)

    def _decision_info(self, mask: NDArray[np.bool_] | None = None) -> dict[str, Any]:
        values = self.world.read_decisions()
        decided = values.pop("has_decision")
        if mask is not None:
            for array in values.values():
                array[~mask] = 0
            decided &= mask
        elif self._same_step and not self.tick_info and not decided.any():
            # The decisions are in `final_info`.
            return {}
        return values | dict.fromkeys(_DECISION_MASKS, decided)


class HybridTrackQuickestVectorEnv(TrackVectorEnv):
    """A vector environment of N `HybridTrackQuickestEnv` tracks, as `HybridTrackVectorEnv`.

    Args:
        num_envs, autoreset_mode, tick_info, threads: as in `HybridTrackVectorEnv`.
        options: see `QuickestOptions`.
    """

    options: QuickestOptions
    options_class = QuickestOptions
    evidence_panel = probability_panel()

    def _record(self, history: History, track: int, info: dict[str, Any], finished: bool) -> None:
        record_statement(history, int(self.world.actions[track]), info, finished)
