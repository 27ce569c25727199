"""The arrays of N tracks and the calls of the kernel. The environments are built on it."""

import functools
import operator
import os
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from hybrid_env.checks import ArgumentError, ReadOnlyAttributes, reject
from hybrid_env.core.compilation import prepare
from hybrid_env.core.kernels import BANKS, KERNELS
from hybrid_env.core.memory import aligned_zeros
from hybrid_env.core.observation_row import LOG_FLOOR, LOG_SCALE, TICK_SCALE
from hybrid_env.core.records import (
    BLOCK,
    DECISION,
    DECISION_FLAGS,
    LANES,
    SCRATCH,
    TICK,
    TICK_NAMES,
    TRACE_COLUMNS,
)
from hybrid_env.observation import Layout
from hybrid_env.options import WorldOptions


class World(ReadOnlyAttributes):
    """State of N tracks under one set of options.

    The arrays can be changed in place, but not replaced, because the kernel has their addresses.

    Args:
        options: options of the model.
        tracks: N, number of tracks.
        trace_rows: number of ticks per step stored for rendering and recording, 0 to store none.
        threads: number of threads that step different blocks of tracks in parallel.

    Raises:
        ArgumentError: the arrays do not fit into memory.
    """

    read_only = frozenset(
        (
            "options", "layout", "threads", "bank", "blocks", "actions", "trace", "observations", "rewards",
            "terminated", "decisions", "decision_flags", "seeded",
        )
    )  # fmt: skip

    def __init__(
        self,
        options: WorldOptions,
        tracks: int,
        trace_rows: int = 0,
        threads: int = 1,
    ):
        self.options = options
        self.layout = Layout(options.hypotheses)
        self.threads = min(threads, -(-tracks // LANES))
        try:
            self._allocate(tracks, trace_rows)
        except (MemoryError, OSError, OverflowError, ValueError):
            raise reject(
                "num_envs", tracks, f"a number of tracks with {trace_rows} trace_rows that fits into memory"
            ) from None
        self._bind()

    def _allocate(self, tracks: int, trace_rows: int) -> None:
        """Create all arrays that the kernel reads and writes, except the scratch memory of the threads."""
        blocks = -(-tracks // LANES)
        allocate = BANKS[self.options.bank]
        self.bank: Any = allocate(len(self.options.radii), self.options.axes, blocks)
        self.blocks = aligned_zeros((blocks,), BLOCK)
        self.actions = np.zeros(tracks, np.int64)
        self.trace = np.zeros((tracks, trace_rows, len(TRACE_COLUMNS)))
        self.observations = aligned_zeros((tracks, self.layout.width), np.float32)
        self.rewards = np.zeros(tracks)
        self.terminated = np.zeros(tracks, np.bool_)
        self.decisions = np.zeros((len(DECISION), tracks), np.int64)
        self.decision_flags = np.zeros((len(DECISION_FLAGS), tracks), np.bool_)
        self.seeded = np.zeros(tracks, np.bool_)
        self._radii = np.array(self.options.radii)
        self._table = self.options.table

    def _bind(self) -> None:
        """Write the array addresses into one parameter record per thread, with scratch memory for each."""
        self._advance = KERNELS[self.options.bank, self.options.follow]
        prepare(self._advance, 0, False)
        arrays = self.bank._asdict() | {
            "actions": self.actions, "blocks": self.blocks, "radii": self._radii, "table": self._table,
            "trace": self.trace, "observations": self.observations, "rewards": self.rewards,
            "terminated": self.terminated, "decisions": self.decisions,
            "decision_flags": self.decision_flags,
        }  # fmt: skip
        cuts = np.linspace(0, len(self.blocks), self.threads + 1).astype(np.int64)
        self._parameters, self._scratch = [], []
        for thread in range(self.threads):
            scratch = {"scratch": aligned_zeros((1,), SCRATCH)}
            scratch |= {
                name: aligned_zeros(array.shape, array.dtype)
                for name, array in self.bank._asdict().items()
                if name in ("innovations", "gains")
            }
            parameters = self.options.parameters()
            parameters["tracks"], parameters["trace_rows"] = self.trace.shape[:2]
            parameters["blocks_count"], parameters["table_rows"] = len(self.blocks), len(self._table)
            parameters["first_block"], parameters["last_block"] = cuts[thread : thread + 2]
            for name, array in (arrays | scratch).items():
                parameters[name] = array.ctypes.data
            self._parameters.append(parameters)
            self._scratch.append(scratch)
        # the leading bytes of every block, copied as raw memory for speed
        front = np.dtype((np.void, TICK.itemsize))
        self._ticks = np.ndarray(self.blocks.shape, front, self.blocks, 0, self.blocks.strides)
        self._log_likelihood = self.bank.hypotheses["log_likelihood"]
        addresses = [parameters.ctypes.data for parameters in self._parameters]
        ranges = [slice(*(LANES * cuts[k : k + 2]).tolist()) for k in range(self.threads)]
        self._pool: ThreadPoolExecutor | None = None
        self._pool_process = 0
        self._run: Callable[[bool], int]
        self.take_rows: Callable[
            [], NDArray[np.float32]
        ]  # after a step or reset, once: (N, width), a new array
        if self.threads == 1:
            self._run = functools.partial(self._advance, addresses[0])
            self.take_rows = self.observations.copy
        else:
            shares = list(zip(addresses, ranges, strict=True))
            self._run = functools.partial(self._run_threads, shares)
            self.take_rows = self._rows_of_threads

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return the arrays that hold the state, by name. They are views, not copies."""
        return {
            "blocks": self.blocks, "actions": self.actions, "trace": self.trace,
            "observations": self.observations, "rewards": self.rewards, "terminated": self.terminated,
            "decisions": self.decisions, "decision_flags": self.decision_flags, "seeded": self.seeded,
            **{f"bank.{name}": array for name, array in self.bank._asdict().items()},
        }  # fmt: skip

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Copy the state of a world with the same options and number of tracks from its `arrays()`.

        Raises:
            ArgumentError: an array is missing, or has another type or shape, or an index is out of range.
                Nothing is copied.
        """
        own = self.arrays()
        for name, array in own.items():
            other = arrays.get(name)
            if not isinstance(other, np.ndarray) or (other.dtype, other.shape) != (array.dtype, array.shape):
                raise ArgumentError(
                    f"the state of the tracks has no array {name} of {array.dtype.itemsize} bytes an element "
                    f"and shape {array.shape}: it was saved by another version of hybrid_env or with other "
                    "options"
                )
        self.check_blocks(arrays["blocks"], arrays["seeded"])
        for name, array in own.items():
            array[...] = arrays[name]

    def check_blocks(self, blocks: NDArray[Any], seeded: NDArray[np.bool_]) -> None:
        """Check the fields of blocks that the kernel uses as indices, as lengths of loops and as seeds.

        Args:
            blocks: (B,) records `BLOCK`.
            seeded: (N,) tracks whose random stream has been seeded.

        Raises:
            ArgumentError: a value is out of range, which the kernel would not notice.
        """
        modes, longest = self.options.hypotheses, self.options.longest_segment
        largest = {
            "segment": self.options.segments - 1, "true_mode": modes - 1, "active_mode": modes - 1,
            "length": longest, "tick": longest, "trace_length": self.trace.shape[1],
        }  # fmt: skip
        for name, last in largest.items():
            values = blocks[name]
            if (values < 0).any() or (values > last).any():
                raise reject(f"blocks.{name}", values, f"integers from 0 to {last}")
        if (blocks["tick"] > blocks["length"]).any():
            raise reject("blocks.tick", blocks["tick"], "at most the length of the segment")
        if not self._flatten_blocks(blocks["random_state"])[seeded].any(1).all():
            raise reject("blocks.random_state", 0, "a state that is not zero")

    def __getstate__(self) -> dict[str, Any]:
        size = {"tracks": self.actions.size, "trace_rows": self.trace.shape[1], "threads": self.threads}
        return size | {"options": self.options, "arrays": self.arrays()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        # new arrays: those of a copy are neither aligned nor in huge pages, and may be read-only
        arrays = state.pop("arrays")
        self.__init__(**state)  # type: ignore[misc]
        self.restore(arrays)

    def _run_threads(self, shares: list[tuple[int, slice]], reset: bool) -> int:
        """Step and copy every share of the tracks in a thread; the calling thread takes the first share."""
        if self._pool is None or self._pool_process != os.getpid():  # a forked process has no threads
            self._pool, self._pool_process = ThreadPoolExecutor(self.threads - 1), os.getpid()
        pool = self._pool
        self._rows = np.empty_like(self.observations)
        jobs = [pool.submit(self._run_share, *share, reset) for share in shares[1:]]
        events = [self._run_share(*shares[0], reset), *(job.result() for job in jobs)]
        # every thread checks all actions, so that all report the same invalid one
        return events[0] if events[0] < 0 else functools.reduce(operator.or_, events)

    def _run_share(self, address: int, tracks: slice, reset: bool) -> int:
        events: int = self._advance(address, reset)
        self._rows[tracks] = self.observations[tracks]
        return events

    def close(self) -> None:
        """End the threads; the next step starts them again."""
        if self._pool is not None:
            self._pool.shutdown()
            self._pool = None

    def _rows_of_threads(self) -> NDArray[np.float32]:
        return self._rows

    def field(self, name: str) -> NDArray[Any]:
        """Return a copy of a field of `BLOCK`, (N, ...)."""
        return self._flatten_blocks(self.blocks[name].copy())

    def _flatten_blocks(self, values: NDArray[Any]) -> NDArray[Any]:
        """Reshape a field of all blocks, (B, ..., LANES), to (N, ...)."""
        by_lane = values if values.ndim == 2 else values.swapaxes(1, 2)
        return by_lane.reshape(-1, *by_lane.shape[2:])[: self.actions.size]

    def copy_tick(self) -> Callable[[], dict[str, NDArray[Any]]]:
        """Copy the current tick of every track. The returned function creates the info arrays, (N, ...)."""
        return functools.partial(self._tick_arrays, self._ticks.copy(), self._log_likelihood.copy())

    def _tick_arrays(
        self, ticks: NDArray[Any], log_likelihood: NDArray[np.float64]
    ) -> dict[str, NDArray[Any]]:
        fields = ticks.view(TICK)
        arrays = {name: self._flatten_blocks(fields[name]) for name in TICK_NAMES}
        return arrays | {"log_likelihood": self._flatten_blocks(log_likelihood)}

    def read_decisions(self) -> dict[str, NDArray[Any]]:
        """Return copies of `DECISION` and `DECISION_FLAGS` of the last step, (N,), zero if undecided."""
        rows, flags = self.decisions.copy(), self.decision_flags.copy()
        values: dict[str, NDArray[Any]] = {key: rows[k] for k, key in enumerate(DECISION)}
        values["decided_squared_error"] = values["decided_squared_error"].view(np.float64)
        for k, key in enumerate(DECISION_FLAGS):
            values[key] = flags[k]
        return values

    @property
    def nbytes(self) -> int:
        """Memory size of all tracks [bytes]."""
        arrays = (
            *self.bank, self.blocks, self.observations, self.rewards, self.terminated, self.decisions,
            self.decision_flags, self.trace,
        )  # fmt: skip
        return sum(array.nbytes for array in arrays)

    def seed(self, tracks: int | NDArray[np.int64], states: NDArray[np.uint64]) -> None:
        """Set the random streams of one or n tracks. states: (4,) or (n, 4), see `hybrid_env.seeding`."""
        blocks, lanes = np.divmod(tracks, LANES)
        self.blocks["random_state"][blocks, :, lanes] = states
        self.seeded[tracks] = True

    def reset(self, mask: NDArray[np.bool_]) -> None:
        """Begin a new episode on the tracks of a mask, (N,)."""
        self.actions[:] = mask
        self._run(True)

    def step(self) -> int:
        """Step every track with `actions`. A terminated track begins its next episode.

        Returns:
            `kernel.DECIDED` if any track made a decision, plus `kernel.TERMINATED` if any terminated.

        Raises:
            InvalidAction: an action is outside the space. No track is stepped.
        """
        events = self._run(False)
        if events < 0:
            raise self.invalid_action(int(self.actions[-1 - events]))
        return events

    def read_trace(self, track: int) -> NDArray[np.float64]:
        """Return the ticks of the last step of a track, (ticks, len(TRACE_COLUMNS))."""
        block, lane = divmod(track, LANES)
        return self.trace[track, : self.blocks["trace_length"][block, lane]].copy()

    def observation_space(self) -> spaces.Box:
        """Return the observation space of one track, with the bounds of bounded quantities."""
        unbounded = float(np.finfo(np.float32).max)
        low = np.full(self.layout.width, -unbounded, np.float32)
        high = np.full(self.layout.width, unbounded, np.float32)
        bounds: dict[str, tuple[float, float]] = {
            "log_ratio": (LOG_SCALE * LOG_FLOOR, 0.0),
            "log_error_probability": (LOG_SCALE * LOG_FLOOR, 0.0),
            "log_variance": (0.0, unbounded),
            "previous": (0.0, 1.0),
            "ticks": (0.0, TICK_SCALE * self.options.longest_segment * (1 + 1e-6)),
            "ticks_left": (0.0, TICK_SCALE * self.options.longest_segment * (1 + 1e-6)),
            "speed": (0.0, unbounded),
            "anchor_xx": (0.0, unbounded),
            "anchor_vv": (0.0, unbounded),
        }
        for name, (lowest, highest) in bounds.items():
            low[self.layout.slices[name]] = lowest
            high[self.layout.slices[name]] = highest
        return spaces.Box(low, high, dtype=np.float32)

    def action_space(self) -> spaces.Discrete:
        """Return the action space of one track: 0 waits, other actions declare a hypothesis."""
        return spaces.Discrete(self.options.action_count)

    def invalid_action(self, action: Any) -> Exception:
        """Return the error for an action outside the space."""
        last = self.options.action_count - 1
        return gym.error.InvalidAction(
            f"action={action!r} is not allowed: expected an integer from 0 (wait) to {last}"
        )
