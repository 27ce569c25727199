"""The arrays of N tracks of `HybridTrackEnv`."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_env.checks import reject
from hybrid_env.core.observation_row import LOG_FLOOR, LOG_SCALE, TICK_SCALE
from hybrid_env.core.records import DECISION, DECISION_FLAGS, LANES
from hybrid_env.observation import Layout
from hybrid_env.options import WorldOptions
from hybrid_env.worlds.tracks import Tracks


class World(Tracks):
    """State of N tracks under one set of `WorldOptions`; see `Tracks`."""

    hypothesis_field, layout_class, first_action = "log_likelihood", Layout, "wait"

    options: WorldOptions

    def largest(self) -> dict[str, int]:
        """See `Tracks.largest`."""
        modes, longest = self.options.hypotheses, self.options.longest_segment
        return {
            "segment": self.options.segments - 1, "true_mode": modes - 1, "active_mode": modes - 1,
            "length": longest, "tick": longest, "trace_length": self.trace.shape[1],
        }  # fmt: skip

    def check_blocks(self, blocks: NDArray[Any], seeded: NDArray[np.bool_]) -> None:
        """See `Tracks.check_blocks`; a tick is also compared with the length of its segment."""
        super().check_blocks(blocks, seeded)
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
