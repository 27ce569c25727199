"""The arrays of N tracks and the calls of the kernel. The environments are built on it."""

import functools
import operator
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from hybrid_env.core import kernel
from hybrid_env.core.compilation import prepare
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


class World:
    """State of N tracks under one set of options.

    Args:
        options: options of the model.
        tracks: N, number of tracks.
        trace_rows: number of ticks per step stored for rendering and recording, 0 to store none.
        threads: number of threads that step different blocks of tracks in parallel.
    """

    def __init__(
        self,
        options: WorldOptions,
        tracks: int,
        trace_rows: int = 0,
        threads: int = 1,
    ):
        self.options = options
        self.layout = Layout(options.hypotheses)
        blocks = -(-tracks // LANES)
        self.threads = min(threads, blocks)
        allocate = kernel.BANKS[options.bank][0]
        self.bank: Any = allocate(len(options.radii), options.variances.size, blocks)
        self.blocks = aligned_zeros((blocks,), BLOCK)
        self.actions = np.zeros(tracks, np.int64)
        self.trace = np.zeros((tracks, trace_rows, len(TRACE_COLUMNS)))
        self.observations = aligned_zeros((tracks, self.layout.width), np.float32)
        self.rewards = np.zeros(tracks)
        self.terminated = np.zeros(tracks, np.bool_)
        self.decisions = np.zeros((len(DECISION), tracks), np.int64)
        self.decision_flags = np.zeros((len(DECISION_FLAGS), tracks), np.bool_)
        self.seeded = np.zeros(tracks, np.bool_)
        self._radii = np.array(options.radii)
        self._table = options.table
        self._bind()

    def _bind(self) -> None:
        """Write the array addresses into one parameter record per thread, with scratch memory for each."""
        self._advance = kernel.BANKS[self.options.bank][1]
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

    def __getstate__(self) -> dict[str, Any]:
        bound = (
            "_parameters",
            "_scratch",
            "_ticks",
            "_log_likelihood",
            "_run",
            "_rows",
            "take_rows",
            "_advance",
            "_pool",
            "_pool_process",
        )
        return {name: value for name, value in self.__dict__.items() if name not in bound}

    def __setstate__(self, state: dict[str, Any]) -> None:
        # copied and unpickled arrays have new addresses and may be read-only
        for name, value in state.items():
            if isinstance(value, np.ndarray):
                value = np.require(value, requirements=["C", "W"])
            setattr(self, name, value)
        self.bank = type(self.bank)(*(np.require(array, requirements=["C", "W"]) for array in self.bank))
        if self.blocks.dtype != BLOCK:
            raise ValueError("this environment was pickled by another version of hybrid_env")
        self._bind()

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

    def seed(self, track: int, generator: np.random.Generator) -> None:
        """Seed the random stream of one track from a generator."""
        block, lane = divmod(track, LANES)
        self.blocks["random_state"][block, :, lane] = generator.integers(1, 2**64, 4, dtype=np.uint64)
        self.seeded[track] = True

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
