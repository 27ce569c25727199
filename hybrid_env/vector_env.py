"""The vector environments: N tracks in one kernel call."""

from collections.abc import Callable, Sequence
from numbers import Integral
from typing import Any, ClassVar

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from hybrid_env.checks import FloatArray, ReadOnlyAttributes, check_flag, check_integer, check_reset_options, reject
from hybrid_env.core.kernel import TERMINATED
from hybrid_env.core.records import DECISION, DECISION_FLAGS
from hybrid_env.options import WorldOptions
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.world import World, random_states

LARGEST = 2**31 - 1  # tracks, and rows of a trace
Step = tuple[NDArray[np.float32], FloatArray, NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]
"""Observations (N, width), rewards, terminated and truncated (N,), and info."""
_DECISION_MASKS = tuple(f"_{key}" for key in DECISION + DECISION_FLAGS if key != "has_decision")
_DICT_METHODS = (
    "__getitem__", "__setitem__", "__delitem__", "__contains__", "__iter__", "__len__", "__reversed__",
    "__eq__", "__ne__", "__or__", "__ror__", "__ior__", "__repr__",
    "get", "keys", "values", "items", "copy", "pop", "popitem", "setdefault", "update", "clear",
)  # fmt: skip


class LazyInfo(dict[str, Any]):
    """A dictionary of arrays of N tracks and their masks `_key`, all one array of True, made at its first use: most
    callers of `step` never read `info`, and its arrays take as long as a step of eight tracks. The state is copied in
    the step. Code in C that reads the size of a dictionary directly, such as `json.dumps`, sees an empty one until
    then: pass it `dict(info)`. `make` is called at most once; `made` are further entries.
    """

    __slots__ = ("_made", "_make")
    fromkeys = staticmethod(dict.fromkeys)  # type: ignore[assignment]

    def __init__(self, make: Callable[[], dict[str, NDArray[Any]]], made: dict[str, Any]):
        self._make: Callable[[], dict[str, NDArray[Any]]] | None = make
        self._made = made

    def fill(self) -> None:
        """Create the entries, unless they exist."""
        if self._make is not None:
            arrays, self._make = self._make(), None
            mask = np.ones(len(arrays["tick"]), np.bool_)
            dict.update(self, arrays | {f"_{key}": mask for key in arrays} | self._made)

    def __reduce__(self) -> tuple[Any, ...]:
        return dict, (dict(self.items()),)  # pickled and copied as a plain dictionary


def _fill_first(name: str) -> Callable[..., Any]:
    method = getattr(dict, name)

    def wrapper(self: LazyInfo, *arguments: Any, **keywords: Any) -> Any:
        self.fill()
        return method(self, *arguments, **keywords)

    wrapper.__name__, wrapper.__doc__ = name, method.__doc__
    return wrapper


for _name in _DICT_METHODS:
    setattr(LazyInfo, _name, _fill_first(_name))


class TrackVectorEnv(ReadOnlyAttributes, VectorEnv[NDArray[np.float32], NDArray[np.int64], NDArray[Any]]):
    """A vector environment of N tracks, as `HybridTrackVectorEnv`; each environment has a subclass with its options."""

    options_class: ClassVar[Any]
    read_only = frozenset(("num_envs", "options", "world"))

    def __init__(
        self, num_envs: int = 1, autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP, tick_info: bool = True,
        trace_rows: int = 0, threads: int = 1, **options: Any,
    ):  # fmt: skip
        for name in ("render_mode", "max_episode_steps"):
            if (value := options.pop(name, None)) is not None:
                allowed = "None for all tracks in one array, or vectorization_mode='sync' of gym.make_vec"
                raise reject(name, value, allowed)
        self.num_envs = check_integer("num_envs", num_envs, maximum=LARGEST)
        try:
            self.autoreset_mode = AutoresetMode(autoreset_mode)
        except ValueError:
            allowed = ", ".join(repr(mode.value) for mode in AutoresetMode)
            raise reject("autoreset_mode", autoreset_mode, allowed) from None
        self.metadata = {"render_modes": [], "autoreset_mode": self.autoreset_mode}
        self.options = self.options_class.of(**options)
        self.tick_info = check_flag("tick_info", tick_info)
        trace_rows = check_integer("trace_rows", trace_rows, 0, LARGEST)
        self.world = World(self.options, self.num_envs, trace_rows, check_integer("threads", threads, maximum=1024))
        self.single_observation_space = self.world.observation_space()
        self.single_action_space = self.world.action_space()
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._started = False
        self._disabled = self.autoreset_mode is AutoresetMode.DISABLED
        self._same_step = self.autoreset_mode is AutoresetMode.SAME_STEP
        self._shape = (self.num_envs,)
        self._truncated = np.zeros(self.num_envs, np.bool_)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin an episode on every track, or on those of `options["reset_mask"]`, (N,) bool.

        Args:
            seed: an integer s seeds track i with s + i; a sequence has one seed per track; None continues the random
                stream of each track.
            options: may contain "reset_mask". A track outside of it that was never reset raises `ResetNeeded`.
        """
        mask = np.ones(self.num_envs, np.bool_)
        check_reset_options(options)
        if options is not None and "reset_mask" in options:
            mask = options["reset_mask"]
            if not isinstance(mask, np.ndarray) or (mask.dtype, mask.shape) != (np.bool_, self._shape):
                raise reject("reset_mask", mask, f"a bool array of shape ({self.num_envs},)")
            if not mask.any() or np.ma.is_masked(mask):
                raise reject("reset_mask", mask, "at least one True, and no masked element")
            mask = np.array(mask, order="C")
        seeds = self._check_seeds(seed)
        if not (self.world.seeded | mask).all():
            raise gym.error.ResetNeeded("reset() with a reset_mask requires an earlier reset() of all tracks")
        given = np.array([one is not None for one in seeds])
        chosen = np.flatnonzero(mask & (given | ~self.world.seeded))
        if chosen.size:
            self.world.seed(chosen, random_states([seeds[i] for i in chosen.tolist()]))
        self.world.reset(mask)
        self._started = True
        return self.world.take_rows(), self._tick_info(mask)

    def _check_seeds(self, seed: Any) -> Sequence[int | None]:
        """Return one seed or None per track."""
        if seed is None:
            return [None] * self.num_envs
        if isinstance(seed, Integral):
            first = check_integer("seed", seed, minimum=0)
            return range(first, first + self.num_envs)
        if isinstance(seed, np.ndarray):
            seed = seed.tolist()  # a number if it has no dimension
        if not isinstance(seed, Sequence) or isinstance(seed, str) or len(seed) != self.num_envs:
            raise reject("seed", seed, f"an integer, or a sequence of {self.num_envs} integers or None")
        return [None if one is None else check_integer("seed", one, minimum=0) for one in seed]

    def action_array(self, actions: Any) -> NDArray[np.int64]:
        """Return actions as an array of integers, (N,). Raises `InvalidAction` if shape or type are wrong."""
        try:
            array = np.asarray(actions)
        except (TypeError, ValueError, RuntimeError):  # ragged, or a tensor with a gradient
            array = np.array(None)
        if array.shape != self._shape or array.dtype.kind not in "iu":
            found = f"actions have shape {array.shape} and type {array.dtype}"
            raise gym.error.InvalidAction(f"{found}: expected integers of shape ({self.num_envs},)")
        return array

    def step(self, actions: NDArray[np.int64]) -> Step:
        """Step every track. Returns observations, rewards, terminated, truncated and info as fresh arrays.

        actions: (N,) integers of the action space; others raise `InvalidAction`, and no track is stepped.
        """
        if not self._started:
            raise gym.error.ResetNeeded("step() requires a running episode: call reset() first")
        actions = self.action_array(actions)
        world = self.world
        if self._disabled and world.terminated.any():
            advice = "reset() terminated tracks with a reset_mask first"
            raise gym.error.ResetNeeded(f"step() requires running episodes: {advice}")
        world.actions[:] = actions
        events = world.step()

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
        if events:
            final = self._decision_info() | final
        info = LazyInfo(world.copy_tick(), final) if self.tick_info else final
        return world.take_rows(), rewards, terminated, self._truncated.copy(), info

    def close_extras(self, **kwargs: Any) -> None:
        """End the threads, if there are any."""
        self.world.close()

    def _tick_info(self, mask: NDArray[np.bool_]) -> dict[str, Any]:
        """Return the info of the current tick, zero for tracks outside a mask, (N,)."""
        values = self.world.copy_tick()()
        for array in values.values():
            array[~mask] = 0
        mask = mask.copy()
        return values | {f"_{key}": mask for key in values}

    def _decision_info(self, mask: NDArray[np.bool_] | None = None) -> dict[str, Any]:
        """Return further info of the last step, zero for tracks outside a mask, (N,); by default nothing."""
        return {}


class HybridTrackVectorEnv(TrackVectorEnv):
    """A vector environment of N `HybridTrackEnv` tracks, stepped in one kernel call.

    With seed s, track i equals the single environment with seed s + i, bit for bit and across autoresets. Spaces,
    rewards and info keys are those of `HybridTrackEnv`, batched. As in Gymnasium, a mask `_key` marks the tracks for
    which an info key is valid.

    Args:
        num_envs: N, number of tracks.
        autoreset_mode: NEXT_STEP resets a terminated track in the next step, whose action is ignored and whose reward
            is 0; SAME_STEP resets it in the same step and returns `final_obs` and `final_info`; DISABLED requires a
            call of `reset(options={"reset_mask": ...})`.
        tick_info: False omits the description of the current tick from the info of `step`, which is faster for
            training. Decisions, `final_obs` and `final_info` are always present.
        trace_rows: number of ticks per step stored in `world.trace`, 0 to store none.
        threads: number of threads that step the tracks in parallel. Results do not depend on it. More than one is
            useful from about 4,000 tracks.
        options: see `WorldOptions`.
    """

    options: WorldOptions
    options_class = WorldOptions

    def _decision_info(self, mask: NDArray[np.bool_] | None = None) -> dict[str, Any]:
        values = self.world.read_decisions()
        decided = values.pop("has_decision")
        if mask is not None:
            for array in values.values():
                array[~mask] = 0
            decided &= mask
        elif self._same_step and not decided.any():
            return {}  # the decisions are in `final_info`
        return values | dict.fromkeys(_DECISION_MASKS, decided)


class HybridTrackQuickestVectorEnv(TrackVectorEnv):
    """A vector environment of N `HybridTrackQuickestEnv` tracks, as `HybridTrackVectorEnv`.

    Args:
        num_envs, autoreset_mode, tick_info, threads: as in `HybridTrackVectorEnv`.
        options: see `QuickestOptions`.
    """

    options: QuickestOptions
    options_class = QuickestOptions
