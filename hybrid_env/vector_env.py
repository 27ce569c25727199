"""The vector environments: N tracks in one kernel call."""

from collections.abc import Mapping, Sequence
from numbers import Integral
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from hybrid_env.checks import (
    AnyArray,
    BoolArray,
    Float32Array,
    FloatArray,
    Info,
    IntArray,
    NotNegative,
    ReadOnlyAttributes,
    check_choice,
    check_flag,
    check_integer,
    checked,
    elements,
    frozen,
    reject,
)
from hybrid_env.core.kernel import TERMINATED
from hybrid_env.options import WorldOptions
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.rendering.history import History
from hybrid_env.rendering.window import RENDER_FPS, Renderer
from hybrid_env.world import World, random_states

# Tracks, and rows of a trace.
LARGEST = 2**31 - 1
Step = tuple[Float32Array, FloatArray, BoolArray, BoolArray, Info]
"""Observations (N, width), rewards, terminated and truncated (N,), and info."""


class TrackVectorEnv(ReadOnlyAttributes, VectorEnv[Float32Array, IntArray, AnyArray]):
    """A vector environment of N tracks, as `HybridTrackVectorEnv`; each environment has a
    subclass with its options.
    """

    options_class: Any
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
        # A frame has two columns and at most two rows.
        rendered = 0 if render_mode is None else min(4, self.num_envs)
        # The ticks of its running episode, and what draws them.
        self._scenes = [(History(), Renderer(self.options, human=False)) for _ in range(rendered)]
        self.single_observation_space = self.world.observation_space()
        self.single_action_space = self.world.action_space()
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._started = False
        self._disabled = self.autoreset_mode is AutoresetMode.DISABLED
        self._same_step = self.autoreset_mode is AutoresetMode.SAME_STEP
        self._shape = (self.num_envs,)
        self._truncated = np.zeros(self.num_envs, bool)
        # Shared by the info of all steps, and therefore read-only.
        self._every_track = frozen(np.ones(self.num_envs, bool))

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: Info | None = None,
    ) -> tuple[Float32Array, Info]:
        """Begin an episode on every track, or on those of `options["reset_mask"]`, (N,) bool.

        Args:
            seed: an integer s seeds track i with s + i; a sequence has one seed per track; None
                continues the random stream of each track.
            options: may contain "reset_mask". A track outside of it that was never reset raises
                `ResetNeeded`.
        """
        mask = np.ones(self.num_envs, bool)
        checked("options", options, Mapping | None)
        if options is not None and "reset_mask" in options:
            given = options["reset_mask"]
            mask = np.array(given, order="C") if isinstance(given, np.ndarray) else np.zeros(1)
            expected = mask.dtype == bool and mask.shape == self._shape and mask.any()
            if not expected or np.ma.is_masked(given):
                allowed = (
                    f"a bool array of shape ({self.num_envs},), at least one True, none masked"
                )
                raise reject("reset_mask", given, allowed)
        seeds = self._check_seeds(seed)
        if not (self.world.seeded | mask).all():
            raise gym.error.ResetNeeded(
                "reset() with a reset_mask requires an earlier reset() of all tracks"
            )
        given = np.array([track_seed is not None for track_seed in seeds])
        chosen = np.flatnonzero(mask & (given | ~self.world.seeded))
        if chosen.size:
            self.world.seed(chosen, random_states([seeds[i] for i in chosen.tolist()]))
        self.world.reset(mask)
        self._started = True
        self._record_scenes(mask, mask)
        info = self._tick_info(mask)
        if self.tick_info:
            info |= self._decision_info(np.zeros(self.num_envs, bool))
        return self.world.take_rows(), info

    def _check_seeds(self, seed: Any) -> Sequence[int | None]:
        """Return one seed or None per track."""
        if seed is None:
            return [None] * self.num_envs
        if isinstance(seed, Integral):
            first = check_integer("seed", seed, minimum=0)
            return range(first, first + self.num_envs)
        seeds = elements(seed)
        if len(seeds) != self.num_envs or (seeds is not seed and np.ndim(seed) == 0):
            allowed = f"an integer, or a sequence of {self.num_envs} integers or None"
            raise reject("seed", seed, allowed)
        return [checked("seed", track_seed, NotNegative | None) for track_seed in seeds]

    def action_array(self, actions: Any) -> IntArray:
        """Return actions as an array of integers, (N,). Raises `InvalidAction` if shape or type
        are wrong.
        """
        try:
            array = np.asarray(actions)
        except (TypeError, ValueError, RuntimeError):
            # Ragged, or a tensor with a gradient.
            array = np.array(None)
        if array.shape != self._shape or array.dtype.kind not in "iu":
            given = f"actions have shape {array.shape} and type {array.dtype}"
            raise gym.error.InvalidAction(f"{given}: expected integers of shape ({self.num_envs},)")
        return array

    def step(self, actions: IntArray) -> Step:
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

        terminated = world.terminated.copy()
        rewards = world.rewards.copy()
        final: Info = {}
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

    def action_masks(self) -> BoolArray:
        """Return which actions count now, (N, actions)."""
        return self.world.action_mask > 0

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
        frames = [renderer.draw(history) for history, renderer in self._scenes]
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
        for track, (history, _) in enumerate(self._scenes):
            if not stepped[track]:
                continue
            described = info | decisions if decided[track] and not begins[track] else info
            if begins[track]:
                history.begin()
            described = {name: values[track] for name, values in described.items()}
            history.record(self.world, track, described, self.world.terminated.item(track))

    def _tick_info(self, mask: BoolArray | None = None) -> Info:
        """Return the info of the current tick, zero for tracks outside a mask, (N,); all tracks
        without one.
        """
        values: Info = {"action_mask": self.world.action_mask.copy()} | self.world.bank_tick()
        if self.tick_info:
            values |= self.world.copy_tick()
        if mask is None:
            mask = self._every_track
        else:
            mask = mask.copy()
            for array in values.values():
                array[~mask] = 0
        return values | {f"_{key}": mask for key in values}

    def _decision_info(self, mask: BoolArray | None = None) -> Info:
        """Return the decisions of the last step, zero for tracks outside a mask, (N,); none with
        unknown switches.
        """
        if self.options.switches == "unknown":
            return {}
        values = self.world.read_decisions()
        decided = values.pop("has_decision")
        if mask is not None:
            for array in values.values():
                array[~mask] = 0
            decided &= mask
        elif self._same_step and not self.tick_info and not decided.any():
            # The decisions are in `final_info`.
            return {}
        return values | {f"_{key}": decided for key in values}


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


class HybridTrackQuickestVectorEnv(TrackVectorEnv):
    """A vector environment of N `HybridTrackQuickestEnv` tracks, as `HybridTrackVectorEnv`.

    Args:
        num_envs, autoreset_mode, tick_info, threads: as in `HybridTrackVectorEnv`.
        options: see `QuickestOptions`.
    """

    options: QuickestOptions
    options_class = QuickestOptions
