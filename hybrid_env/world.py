"""The state of N tracks and the calls of the kernel that steps them, for all environments."""

import functools
import operator
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.utils import seeding
from numpy.typing import NDArray

from hybrid_env.checks import AnyArray, BoolArray, Float32Array, FloatArray, IntArray, reject
from hybrid_env.core.bank_ticks import full_matrices, read_bank_ticks
from hybrid_env.core.errors import ArgumentError
from hybrid_env.core.kernels import RESET, STEP, entry_point
from hybrid_env.core.memory import (
    DECISION,
    DECISION_FLAGS,
    LANES,
    PARAMETERS,
    Arrays,
    allocate,
    declared,
)
from hybrid_env.core.noise import draw_failed
from hybrid_env.core.observation_row import LOG_FLOOR
from hybrid_env.observation import Layout


class World:
    """State of N tracks under the options of an environment, stepped by some threads. The kernel
    has the addresses of the arrays: they are changed in place, not replaced. A trace has
    `trace_rows` ticks of the last step; 0 stores none. With `live` the
    kernels are those of a live sensor, see `hybrid_env.live`, and `run` takes their commands.
    """

    layout: Layout
    # Named tuple of the arrays of all banks; `bank.hypotheses` is (B, M).
    bank: Any
    # (B,) records with the state of `LANES` tracks.
    blocks: AnyArray
    # (N,) of the next step.
    actions: IntArray
    # (N, width)
    observations: Float32Array
    # (N, actions) 1 where an action counts; a declaration with 0 waits.
    action_mask: NDArray[np.int8]
    # (N, M, columns) every filter at the present tick, if asked for.
    bank_ticks: FloatArray
    # (N,) of the last step.
    rewards: FloatArray
    # (N,) whether the episode has ended.
    terminated: BoolArray
    # (N,) whether the random stream has been seeded.
    seeded: BoolArray
    # (N, trace rows, len(TRACE_COLUMNS))
    trace: FloatArray
    # (len(DECISION), N) of the last step, with announced switches.
    decisions: IntArray
    # (len(DECISION_FLAGS), N)
    decision_flags: BoolArray
    # (N, 2, 2, 3) habits drawn for the episodes, see `core.habits`; else empty.
    drawn_law: FloatArray
    # (N, M, M)
    drawn_order: FloatArray

    def __init__(
        self,
        options: Any,
        tracks: int = 1,
        trace_rows: int = 0,
        threads: int = 1,
        bank_info: bool = False,
        live: bool = False,
    ):
        if bank_info and options.switches == "unknown":
            raise reject("bank_info", bank_info, "False with unknown switches")
        if live and options.climbs:
            raise reject("modes", options.modes, "modes of the plane on a live sensor")
        self.options = options
        self.live = live
        self.layout = options.layout_class(options.hypotheses, options.climbs)
        heights = "true_height", "height", "height_estimate"
        self.tick_names = options.tick_names + heights * options.climbs
        self.threads = min(threads, -(-tracks // LANES))
        parameters = np.zeros(1, PARAMETERS)
        fields = options.parameters()
        fields |= {
            "tracks": tracks,
            "blocks_count": -(-tracks // LANES),
            # On a live sensor any measurement may be missing.
            "irregular": fields["irregular"] or live,
            "width": self.layout.width,
            "trace_rows": trace_rows,
            "bank_rows": options.hypotheses if bank_info else 0,
        }
        for name, value in fields.items():
            parameters[name] = value
        sizes = parameters[0]
        bank = options.bank_class
        constant = {name: np.ascontiguousarray(array) for name, array in options.arrays().items()}
        try:
            state = {
                name: allocate(array, sizes) for name, array in declared(Arrays, "tracks").items()
            }
            filters = {
                name: constant[name] if name in constant else allocate(array, sizes)
                for name, array in declared(bank).items()
            }
        except (MemoryError, OSError, OverflowError, ValueError):
            allowed = f"a number of tracks with {trace_rows} trace_rows that fits into memory"
            raise reject("num_envs", tracks, allowed) from None
        for name, array in state.items():
            setattr(self, name, array)
        self.bank = bank(**filters)
        self.action_mask[:] = 1
        self._kept = state | {f"bank.{name}": filters[name] for name in declared(bank, "block")}
        self._constant = constant
        self._bind(parameters, state | filters | constant)

    def arrays(self) -> dict[str, AnyArray]:
        """Return the arrays that hold the state, by name. They are views, not copies."""
        return dict(self._kept)

    def action_space(self) -> spaces.Discrete:
        """Return the action space of one track."""
        return spaces.Discrete(self.options.action_count)

    def invalid_action(self, action: Any) -> gym.error.InvalidAction:
        """Return the error for an action outside the space."""
        allowed = f"an integer from 0 to {self.options.action_count - 1}"
        return gym.error.InvalidAction(str(reject("action", action, allowed)))

    def _bind(self, parameters: AnyArray, arrays: dict[str, AnyArray]) -> None:
        """Write the array addresses into one parameter record per thread, with scratch memory
        for each.
        """
        self._advance = entry_point(self.options.bank_class, parameters[0], self.live)
        cuts = np.linspace(0, len(self.blocks), self.threads + 1).astype(int)
        temporary = declared(Arrays, "thread") | declared(self.options.bank_class, "thread")
        self._parameters = []
        self._scratch = []
        for thread in range(self.threads):
            scratch = {name: allocate(array, parameters[0]) for name, array in temporary.items()}
            parameters["first_block"], parameters["last_block"] = cuts[thread : thread + 2]
            for name, array in (arrays | scratch).items():
                parameters[name] = array.ctypes.data
            self._parameters.append(parameters.copy())
            self._scratch.append(scratch)
        addresses = [parameters.ctypes.data for parameters in self._parameters]
        self._pool: ThreadPoolExecutor | None = None
        self._pool_process = 0
        self.run: Callable[[int], int] = functools.partial(self._advance, addresses[0])
        if self.threads > 1:
            ranges = [slice(*(LANES * cuts[k : k + 2]).tolist()) for k in range(self.threads)]
            shares = list(zip(addresses, ranges, strict=True))
            self.run = functools.partial(self._run_threads, shares)

    def take_rows(self) -> Float32Array:
        """Return the observations as a new array, (N, width); once after a step or reset."""
        return self.observations.copy() if self.threads == 1 else self._rows

    def restore(self, arrays: Mapping[str, AnyArray]) -> None:
        """Copy the state of a world with the same options and number of tracks from its
        `arrays()`.
        """
        for name, array in self._kept.items():
            array[...] = arrays[name]

    def check_blocks(self, blocks: AnyArray, seeded: BoolArray) -> None:
        """Check the fields of blocks that the kernel uses as indices, lengths of loops and,
        where seeded, seeds.
        """
        last = dict.fromkeys(("active_mode", "stated_mode"), self.options.hypotheses - 1)
        if not self.live:
            # A segment may end after an episode whose switches are unknown.
            longest = self.options.longest_segment + (self.options.switches == "unknown")
            last |= dict.fromkeys(("tick", "length", "time", "stated_ticks"), longest)
            last["true_mode"] = self.options.hypotheses - 1
            last["segment"] = self.options.segments - 1
            last["trace_length"] = self.trace.shape[1]
        for name, largest in last.items():
            values = blocks[name]
            if (values < 0).any() or (values > largest).any():
                raise reject(f"blocks.{name}", values, f"integers from 0 to {largest}")
        if (blocks["tick"] > blocks["length"]).any():
            raise reject("blocks.tick", blocks["tick"], "at most the length of the segment")
        if not self._flatten_blocks(blocks["random_state"])[seeded].any(1).all():
            raise reject("blocks.random_state", 0, "a state that is not zero")

    def __getstate__(self) -> dict[str, Any]:
        return {
            "options": self.options,
            "tracks": self.actions.size,
            "trace_rows": self.trace.shape[1],
            "threads": self.threads,
            "bank_info": self.bank_ticks.size > 0,
            "live": self.live,
            "arrays": self.arrays(),
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        # New arrays: those of a copy are neither aligned nor in huge pages, and may be read-only.
        arrays = state.pop("arrays")
        self.__init__(**state)  # type: ignore[misc]
        self.restore(arrays)

    def _run_threads(self, shares: list[tuple[int, slice]], command: int) -> int:
        """Step and copy every share of the tracks in a thread."""
        # A forked process has no threads.
        if self._pool is None or self._pool_process != os.getpid():
            self._pool = ThreadPoolExecutor(self.threads)
            self._pool_process = os.getpid()
        self._rows = np.empty_like(self.observations)
        run = functools.partial(self._run_share, command)
        # Every thread checks all actions, so that all report the same invalid one.
        events = list(self._pool.map(run, shares))
        lowest = min(events)
        return lowest if lowest < 0 else functools.reduce(operator.or_, events)

    def _run_share(self, command: int, share: tuple[int, slice]) -> int:
        address, tracks = share
        events: int = self._advance(address, command)
        self._rows[tracks] = self.observations[tracks]
        return events

    def close(self) -> None:
        """End the threads; the next step starts them again."""
        if self._pool is not None:
            self._pool.shutdown()
            self._pool = None

    def field(self, name: str) -> AnyArray:
        """Return a copy of a field of the blocks, (N, ...)."""
        return self._flatten_blocks(self.blocks[name].copy())

    def write(self, name: str, values: AnyArray) -> None:
        """Write a field of the blocks, (N,) or (N, k)."""
        blocks, lanes = np.divmod(np.arange(len(values)), LANES)
        self.blocks[name][blocks, ..., lanes] = values

    def _flatten_blocks(self, values: AnyArray) -> AnyArray:
        """Reshape a field of all blocks, (B, ..., LANES), to (N, ...)."""
        by_lane = np.moveaxis(values, -1, 1)
        return by_lane.reshape(-1, *by_lane.shape[2:])[: self.actions.size]

    def hypothesis_values(self) -> FloatArray:
        """Return a copy of the log-likelihoods since the switch, or of the log probabilities of
        the modes, (N, M).
        """
        return self._flatten_blocks(self.bank.hypotheses[self.options.hypothesis_field].copy())

    def copy_tick(self) -> dict[str, AnyArray]:
        """Return copies of the current tick of every track by their names in `info`, (N, ...)."""
        ticks = {name: self.field(name) for name in self.tick_names}
        ticks[self.options.hypothesis_field] = self.hypothesis_values()
        return ticks | {name: array.copy() for name, array in self.drawn.items()}

    def bank_tick(self) -> dict[str, FloatArray]:
        """Return what every filter did at the present tick, see `read_bank_ticks`; empty if it
        is not recorded.
        """
        told = read_bank_ticks(self.bank_ticks) if self.bank_ticks.size else {}
        if told and self.options.climbs:
            heights = self._flatten_blocks(self.bank.heights.copy())
            covariances = full_matrices(heights[..., 2:5], 2)
            told |= {"heights": heights[..., :2], "height_covariances": covariances}
        return told

    @property
    def drawn(self) -> dict[str, FloatArray]:
        """Views of the habits that are drawn for every episode, (N, ...), by their names in
        `info`.
        """
        habits = {"law": self.drawn_law, "transitions": self.drawn_order}
        return {name: array for name, array in habits.items() if array.size}

    def read_decisions(self) -> dict[str, AnyArray]:
        """Return copies of `DECISION` and `DECISION_FLAGS` of the last step, (N,), zero if
        undecided.
        """
        values: dict[str, AnyArray] = dict(zip(DECISION, self.decisions.copy(), strict=True))
        values["decided_squared_error"] = values["decided_squared_error"].view(np.float64)
        return values | dict(zip(DECISION_FLAGS, self.decision_flags.copy(), strict=True))

    def read_trace(self, track: int) -> FloatArray:
        """Return the ticks of the last step of a track, (ticks, len(TRACE_COLUMNS))."""
        block, lane = divmod(track, LANES)
        return self.trace[track, : self.blocks["trace_length"][block, lane]].copy()

    def seed(self, tracks: int | IntArray, states: NDArray[np.uint64]) -> None:
        """Set the random streams of one or n tracks. states: (4,) or (n, 4), see
        `random_states`.
        """
        blocks, lanes = np.divmod(tracks, LANES)
        self.blocks["random_state"][blocks, :, lanes] = states
        self.seeded[tracks] = True

    def reset(self, mask: BoolArray) -> None:
        """Begin a new episode on the tracks of a mask, (N,)."""
        self.actions[:] = mask
        if self.run(RESET) < 0:
            raise self._draw_failed()

    def step(self) -> int:
        """Step every track with `actions`; a terminated track begins its next episode. Returns the
        events of the kernel, combined as bits: `DECIDED`, `TERMINATED`. An action outside the space
        raises `InvalidAction`, and no track is stepped.
        """
        events = self.run(STEP)
        if events >= 0:
            return events
        if events < -self.actions.size:
            raise self._draw_failed()
        raise self.invalid_action(int(self.actions[-1 - events]))

    def _draw_failed(self) -> ArgumentError:
        """Return the error of the law of the user; the next step begins anew."""
        for parameters in self._parameters:
            parameters["noise_failed"] = False
        return draw_failed()

    def observation_space(self) -> spaces.Box:
        """Return the observation space of one track, with the bounds of bounded quantities."""
        unbounded = float(np.finfo(np.float32).max)
        longest = self.options.longest_segment * (1 + 1e-6)
        bounds = {
            **dict.fromkeys(("log_ratio", "log_probability"), (LOG_FLOOR, 0.0)),
            "log_error_probability": (LOG_FLOOR, 0.0),
            **dict.fromkeys(("previous", "stated", "measured", "true_mode"), (0.0, 1.0)),
            **dict.fromkeys(("ticks", "ticks_left", "stated_ticks"), (0.0, longest)),
            **dict.fromkeys(("log_variance", "log_variance_up", "speed"), (0.0, unbounded)),
            **dict.fromkeys(("anchor_xx", "anchor_vv"), (0.0, unbounded)),
        }
        low, high = np.outer([-unbounded, unbounded], np.ones(self.layout.width)).astype(np.float32)
        for name, place in self.layout.slices.items():
            if name in bounds:
                scaled = np.multiply(self.layout.scales[name], bounds[name])
                low[place], high[place] = scaled.clip(-unbounded, unbounded)
        return spaces.Box(low, high, dtype=np.float32)


def random_states(seeds: Sequence[int | None]) -> NDArray[np.uint64]:
    """Return the initial states of random streams, (n, 4), of seeds >= 0; None is a random one."""
    return np.array(
        [stream_state(seeding.np_random(seed)[0]) for seed in seeds], np.uint64
    ).reshape(-1, 4)


def stream_state(generator: np.random.Generator) -> NDArray[np.uint64]:
    """Return the state of a random stream drawn from a generator, (4,)."""
    return generator.integers(1, 2**64, 4, dtype=np.uint64)
