"""The arrays of N tracks of `HybridTrackQuickestEnv` and the calls of its kernel."""

from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from hybrid_env.checks import reject
from hybrid_env.core.imm_bank import ImmBank, imm_arrays
from hybrid_env.core.memory import aligned_zeros
from hybrid_env.core.observation_row import LOG_FLOOR, LOG_SCALE, TICK_SCALE
from hybrid_env.core.quickest_kernel import advance_quickest, advance_quickest_robust
from hybrid_env.core.quickest_records import (
    QUICKEST_BLOCK,
    QUICKEST_SCRATCH,
    QUICKEST_TICK,
    QUICKEST_TICK_NAMES,
)
from hybrid_env.core.records import LANES
from hybrid_env.observation import QuickestLayout
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.tracks import Tracks, invalid_integer


class QuickestWorld(Tracks):
    """State of N tracks under one set of `QuickestOptions`; see `Tracks`. No traces are stored."""

    tick_type, tick_names, hypothesis_field = QUICKEST_TICK, QUICKEST_TICK_NAMES, "log_probability"

    options: QuickestOptions
    bank: ImmBank

    def __init__(self, options: QuickestOptions, tracks: int, trace_rows: int = 0, threads: int = 1):
        if trace_rows:
            raise reject("trace_rows", trace_rows, "0: info describes every tick")
        super().__init__(options, tracks, trace_rows, threads)

    def _allocate(self, tracks: int, trace_rows: int) -> None:
        blocks = -(-tracks // LANES)
        self.layout = QuickestLayout(self.options.hypotheses)
        self.bank = imm_arrays(len(self.options.radii), blocks)
        self.blocks = aligned_zeros((blocks,), QUICKEST_BLOCK)
        self.actions = np.zeros(tracks, np.int64)
        self.observations = aligned_zeros((tracks, self.layout.width), np.float32)
        self.rewards = np.zeros(tracks)
        self.terminated = np.zeros(tracks, np.bool_)
        self.seeded = np.zeros(tracks, np.bool_)
        self._model = {
            "radii": np.array(self.options.radii),
            "table": self.options.table,
            "durations": self.options.cumulative_durations,
            "sensors": self.options.sensor_table,
        }

    def _kernel(self) -> Any:
        return advance_quickest_robust if self.options.robust else advance_quickest

    def _addressed_arrays(self) -> dict[str, NDArray[Any]]:
        state = {name.removeprefix("bank."): array for name, array in self.arrays().items()}
        del state["seeded"]
        return state | self._model

    def _scratch_arrays(self) -> dict[str, NDArray[Any]]:
        bank = self.bank
        return {
            "scratch": aligned_zeros((1,), QUICKEST_SCRATCH),
            "innovations": aligned_zeros(bank.innovations.shape, bank.innovations.dtype),
            "sums": aligned_zeros(bank.sums.shape, bank.sums.dtype),
        }

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return the arrays that hold the state, by name. They are views, not copies."""
        return {
            "blocks": self.blocks, "actions": self.actions, "observations": self.observations,
            "rewards": self.rewards, "terminated": self.terminated, "seeded": self.seeded,
            "bank.hypotheses": self.bank.hypotheses,
        }  # fmt: skip

    def check_blocks(self, blocks: NDArray[Any], seeded: NDArray[np.bool_]) -> None:
        """Check the fields of blocks that the kernel uses as indices and as seeds.

        Args:
            blocks: (B,) records `QUICKEST_BLOCK`.
            seeded: (N,) tracks whose random stream has been seeded.

        Raises:
            ArgumentError: a value is out of range, which the kernel would not notice.
        """
        modes, ticks = self.options.hypotheses, self.options.ticks
        largest = {
            "segment": ticks - 1, "true_mode": modes - 1, "stated_mode": modes - 1, "tick": ticks,
            "length": ticks + 1, "time": ticks, "stated_ticks": ticks,
        }  # fmt: skip
        self.check_fields(blocks, seeded, largest)

    def bounds(self) -> dict[str, tuple[float, float]]:
        """Return the smallest and largest value of bounded quantities of the observation, scaled."""
        return {
            "log_probability": (LOG_SCALE * LOG_FLOOR, 0.0),
            "log_ratio": (LOG_FLOOR, 0.0),
            "log_variance": (0.0, np.inf),
            "stated": (0.0, 1.0),
            "speed": (0.0, np.inf),
            "stated_ticks": (0.0, TICK_SCALE * self.options.ticks * (1 + 1e-6)),
        }

    def action_space(self) -> spaces.Discrete:
        """Return the action space of one track: the stated mode."""
        return spaces.Discrete(self.options.hypotheses)

    def invalid_action(self, action: Any) -> gym.error.InvalidAction:
        """Return the error for an action outside the space."""
        return invalid_integer(action, self.options.hypotheses - 1, "straight")
