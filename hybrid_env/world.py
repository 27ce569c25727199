"""The arrays of N tracks of `HybridTrackEnv` and the calls of its kernel."""

from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from hybrid_env.checks import reject
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
from hybrid_env.tracks import Tracks, invalid_integer


class World(Tracks):
    """State of N tracks under one set of `WorldOptions`; see `Tracks`.

    Attributes:
        trace: (N, trace rows, len(TRACE_COLUMNS)) ticks of the last step.
        decisions: (len(DECISION), N) decisions of the last step.
        decision_flags: (len(DECISION_FLAGS), N).
    """

    read_only = Tracks.read_only | {"trace", "decisions", "decision_flags"}
    tick_type, tick_names, hypothesis_field = TICK, TICK_NAMES, "log_likelihood"

    options: WorldOptions

    def _allocate(self, tracks: int, trace_rows: int) -> None:
        blocks = -(-tracks // LANES)
        allocate = BANKS[self.options.bank]
        self.layout = Layout(self.options.hypotheses)
        self.bank = allocate(len(self.options.radii), self.options.axes, blocks)
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
        self._sensors = self.options.sensor_table

    def _kernel(self) -> Any:
        return KERNELS[self.options.bank, self.options.follow, self.options.robust]

    def _addressed_arrays(self) -> dict[str, NDArray[Any]]:
        arrays: dict[str, NDArray[Any]] = self.bank._asdict()
        return arrays | {
            "actions": self.actions, "blocks": self.blocks, "radii": self._radii, "table": self._table,
            "sensors": self._sensors,
            "trace": self.trace, "observations": self.observations, "rewards": self.rewards,
            "terminated": self.terminated, "decisions": self.decisions,
            "decision_flags": self.decision_flags,
        }  # fmt: skip

    def _scratch_arrays(self) -> dict[str, NDArray[Any]]:
        return {"scratch": aligned_zeros((1,), SCRATCH)} | {
            name: aligned_zeros(array.shape, array.dtype)
            for name, array in self.bank._asdict().items()
            if name in ("innovations", "gains")
        }

    def _complete_parameters(self, parameters: NDArray[Any]) -> None:
        parameters["trace_rows"], parameters["table_rows"] = self._trace_rows(), len(self._table)

    def _trace_rows(self) -> int:
        return self.trace.shape[1]

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return the arrays that hold the state, by name. They are views, not copies."""
        return {
            "blocks": self.blocks, "actions": self.actions, "trace": self.trace,
            "observations": self.observations, "rewards": self.rewards, "terminated": self.terminated,
            "decisions": self.decisions, "decision_flags": self.decision_flags, "seeded": self.seeded,
            **{f"bank.{name}": array for name, array in self.bank._asdict().items()},
        }  # fmt: skip

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
        self.check_fields(blocks, seeded, largest)
        if (blocks["tick"] > blocks["length"]).any():
            raise reject("blocks.tick", blocks["tick"], "at most the length of the segment")

    def read_decisions(self) -> dict[str, NDArray[Any]]:
        """Return copies of `DECISION` and `DECISION_FLAGS` of the last step, (N,), zero if undecided."""
        rows, flags = self.decisions.copy(), self.decision_flags.copy()
        values: dict[str, NDArray[Any]] = {key: rows[k] for k, key in enumerate(DECISION)}
        values["decided_squared_error"] = values["decided_squared_error"].view(np.float64)
        for k, key in enumerate(DECISION_FLAGS):
            values[key] = flags[k]
        return values

    def read_trace(self, track: int) -> NDArray[np.float64]:
        """Return the ticks of the last step of a track, (ticks, len(TRACE_COLUMNS))."""
        block, lane = divmod(track, LANES)
        return self.trace[track, : self.blocks["trace_length"][block, lane]].copy()

    def bounds(self) -> dict[str, tuple[float, float]]:
        """Return the smallest and largest value of bounded quantities of the observation, scaled."""
        longest = TICK_SCALE * self.options.longest_segment * (1 + 1e-6)
        return {
            "log_ratio": (LOG_SCALE * LOG_FLOOR, 0.0),
            "log_error_probability": (LOG_SCALE * LOG_FLOOR, 0.0),
            "log_variance": (0.0, np.inf),
            "previous": (0.0, 1.0),
            "ticks": (0.0, longest),
            "ticks_left": (0.0, longest),
            "speed": (0.0, np.inf),
            "anchor_xx": (0.0, np.inf),
            "anchor_vv": (0.0, np.inf),
        }

    def action_space(self) -> spaces.Discrete:
        """Return the action space of one track: 0 waits, other actions declare a hypothesis."""
        return spaces.Discrete(self.options.action_count)

    def invalid_action(self, action: Any) -> gym.error.InvalidAction:
        """Return the error for an action outside the space."""
        return invalid_integer(action, self.options.action_count - 1, "wait")
