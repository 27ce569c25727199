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
    OwnState,
    as_array,
    check_choice,
    check_integer,
    checked,
    elements,
    of_keywords,
    reject,
)
from hybrid_env.core.memory import MEASURED_NAMES
from hybrid_env.options import WorldOptions
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.rendering import METADATA
from hybrid_env.rendering.frame import draw_frame
from hybrid_env.rendering.history import History
from hybrid_env.world import World, random_states


class TrackVectorEnv(OwnState, VectorEnv[Float32Array, IntArray, AnyArray]):
    """A vector environment of N tracks, as `HybridTrackVectorEnv`; each environment has a
    subclass with its options.
    """

    options_class: Any

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
        # Tracks, and rows of a trace.
        largest = 2**31 - 1
        self.num_envs = check_integer("num_envs", num_envs, maximum=largest)
        modes = {mode.value: mode for mode in AutoresetMode}
        given = getattr(autoreset_mode, "value", autoreset_mode)
        self.autoreset_mode = modes[check_choice("autoreset_mode", given, modes)]
        self.metadata = {**METADATA, "autoreset_mode": self.autoreset_mode}
        self.render_mode = render_mode
        self.options = of_keywords(self.options_class, options, ["render_mode"])
        self.tick_info = checked("tick_info", tick_info, bool)
        self.bank_info = checked("bank_info", bank_info, bool)
        trace_rows = check_integer("trace_rows", trace_rows, 0, largest)
        threads = check_integer("threads", threads, maximum=1024)
        # Ticks of the running episode of each track, without a render mode of none.
        self.histories: list[History] = []
        if render_mode is not None:
            check_choice("render_mode", render_mode, ["rgb_array"])
            self.histories = [History(self.options) for _ in range(self.num_envs)]
            trace_rows = max(trace_rows, self.options.longest_step)
        self.world = World(self.options, self.num_envs, trace_rows, threads, self.bank_info)
        self.single_observation_space = self.world.observation_space()
        self.single_action_space = self.world.action_space()
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._started = False
        self._disabled = self.autoreset_mode is AutoresetMode.DISABLED
        self._same_step = self.autoreset_mode is AutoresetMode.SAME_STEP
        self._shape = (self.num_envs,)
        # Steps of the running episodes.
        self._steps = np.zeros(self.num_envs, np.int64)
        limit = largest if max_episode_steps in (None, -1) else max_episode_steps
        self._most_steps = check_integer("max_episode_steps", limit)
        # Whether a step needs to know which episodes it begins.
        self._watched = bool(self.histories) or self.options.longest_episode >= self._most_steps
        # Shared by the info of all steps, and therefore read-only.
        self._every_track = np.ones(self.num_envs, bool)
        self._every_track.setflags(write=False)
        self._no_track = ~self._every_track

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: Info | None = None
    ) -> tuple[Float32Array, Info]:
        """Begin an episode on every track, or on those of `options["reset_mask"]`, (N,) bool.

        Args:
            seed: an integer s seeds track i with s + i; a sequence has one seed per track; None
                continues the random stream of each track.
            options: may contain "reset_mask". A track outside of it that was never reset raises
                `ResetNeeded`.
        """
        checked("options", options, Mapping | None)
        mask = np.array((options or {}).get("reset_mask", self._every_track))
        if mask.dtype != bool or mask.shape != self._shape or not mask.any():
            allowed = f"a bool array of shape ({self.num_envs},), at least one True"
            raise reject("reset_mask", mask, allowed)
        seeds: Any = [None] * self.num_envs if seed is None else seed
        if isinstance(seeds, Integral):
            first = check_integer("seed", seeds, minimum=0)
            seeds = range(first, first + self.num_envs)
        seeds = elements(seeds)
        if len(seeds) != self.num_envs:
            allowed = f"an integer, or a sequence of {self.num_envs} integers or None"
            raise reject("seed", seed, allowed)
        if not (self.world.seeded | mask).all():
            raise gym.error.ResetNeeded(
                "reset() with a reset_mask requires an earlier reset() of all tracks"
            )
        given = np.array([track_seed is not None for track_seed in seeds])
        chosen = np.flatnonzero(mask & (given | ~self.world.seeded))
        if chosen.size:
            self.world.seed(chosen, random_states([seeds[i] for i in chosen.tolist()]))
        self.world.reset(mask)
        self._steps[mask] = 0
        self._started = True
        self._record(mask, mask)
        info = self._tick_info(mask)
        if self.tick_info:
            info |= self._decision_info(np.zeros(self.num_envs, bool))
        return self.world.take_rows(), info

    def step(
        self, actions: IntArray
    ) -> tuple[Float32Array, FloatArray, BoolArray, BoolArray, Info]:
        """Step every track. Returns observations, rewards, terminated, truncated and info as
        fresh arrays.

        actions: (N,) integers of the action space; others raise `InvalidAction`, and no track is
        stepped.
        """
        if not self._started:
            raise gym.error.ResetNeeded("step() requires a running episode: call reset() first")
        actions = as_array(actions)
        if actions.shape != self._shape or actions.dtype.kind not in "iu":
            given = f"actions have shape {actions.shape} and type {actions.dtype}"
            raise gym.error.InvalidAction(f"{given}: expected integers of shape ({self.num_envs},)")
        world = self.world
        if self._disabled and world.terminated.any():
            advice = "reset() terminated tracks with a reset_mask first"
            raise gym.error.ResetNeeded(f"step() requires running episodes: {advice}")
        world.actions[...] = actions
        begins = world.terminated.copy() if self._watched else None
        events = world.step()

        terminated = world.terminated.copy()
        rewards = world.rewards.copy()
        truncated = self._no_track.copy()
        if begins is not None:
            self._record(self._every_track, begins)
            truncated = self._truncate(begins)
        final: Info = {}
        if self._same_step and world.terminated.any():
            ended = world.terminated.copy()
            final_obs = np.full(self.num_envs, None, dtype=object)
            for i in np.flatnonzero(ended):
                final_obs[i] = world.observations[i].copy()
            final_info = self._tick_info(ended) | self._decision_info(ended)
            final = {"final_obs": final_obs, "final_info": final_info}
            final |= {f"_{key}": ended.copy() for key in final}
            world.reset(ended)
            self._steps[ended] = 0
            self._record(ended, ended)
        if events or self.tick_info:
            final = self._decision_info() | final
        if self.tick_info or self.bank_info:
            info = self._tick_info()
        else:
            # Most callers train: nothing else is made.
            info = {"action_mask": world.action_mask.copy(), "_action_mask": self._every_track}
        if final:
            info |= final
        return world.take_rows(), rewards, terminated, truncated, info

    def close_extras(self, **kwargs: Any) -> None:
        """End the threads, if there are any."""
        self.world.close()

    def action_masks(self) -> BoolArray:
        """Return which actions count now, (N, actions)."""
        return self.world.action_mask > 0

    def render(self) -> tuple[Any, ...] | None:
        """Return a frame of every track, (height, width, 3) uint8; None without a render mode."""
        if not self.histories:
            advice = "create it with render_mode='rgb_array'"
            gym.logger.warn(f"render() has no effect without a render_mode: {advice}")
            return None
        if not self._started:
            raise gym.error.ResetNeeded("render() requires a running episode: call reset() first")
        return tuple(draw_frame(history) for history in self.histories)

    def _truncate(self, begins: BoolArray) -> BoolArray:
        """Return which episodes end by the limit of steps, (N,), for the world as terminated ones.
        begins: (N,) the tracks that begin an episode.
        """
        self._steps += 1
        self._steps[begins] = 0
        truncated: BoolArray = self._steps >= self._most_steps
        self.world.terminated |= truncated
        return truncated

    def _record(self, stepped: BoolArray, begins: BoolArray) -> None:
        """Add the last step to the histories. stepped, begins: (N,) which tracks were stepped or
        reset, and which of these begin an episode.
        """
        if not self.histories:
            return
        info = self.world.copy_tick()
        decisions = self.world.read_decisions()
        decided = decisions.pop("has_decision") & ~begins
        for track in np.flatnonzero(stepped).tolist():
            history = self.histories[track]
            if begins[track]:
                history.begin()
            present = info | decisions if decided[track] else info
            present = {name: values[track] for name, values in present.items()}
            history.record(self.world, track, present, self.world.terminated.item(track))

    def _tick_info(self, mask: BoolArray | None = None) -> Info:
        """Return the info of the current tick, zero for tracks outside a mask, (N,), all without
        one, and for what was not measured.
        """
        values: Info = {"action_mask": self.world.action_mask.copy()} | self.world.bank_tick()
        if self.tick_info:
            values |= self.world.copy_tick()
        masks = dict.fromkeys(values, self._every_track if mask is None else mask.copy())
        measured = ~np.isnan(self.world.field("measurement")[:, 0])
        masks |= {name: masks[name] & measured for name in MEASURED_NAMES if name in masks}
        for name, array in values.items():
            array[~masks[name]] = 0
        return values | {f"_{name}": valid for name, valid in masks.items()}

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
        render_mode: "rgb_array" for frames of all tracks.
        max_episode_steps: after which episodes are truncated; None and -1 are no limit.
            `gym.make_vec` gives that of the id.
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
