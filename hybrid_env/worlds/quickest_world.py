"""The arrays of N tracks of `HybridTrackQuickestEnv`."""

import numpy as np

from hybrid_env.checks import reject
from hybrid_env.core.banks.imm import ImmBank
from hybrid_env.core.observation_row import LOG_FLOOR, LOG_SCALE, TICK_SCALE
from hybrid_env.core.records import TICK_NAMES
from hybrid_env.observation import QuickestLayout
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.worlds.tracks import Tracks


class QuickestWorld(Tracks):
    """State of N tracks under one set of `QuickestOptions`; see `Tracks`. No traces are stored."""

    tick_names = tuple(name for name in TICK_NAMES if name != "anchor")
    hypothesis_field, layout_class, first_action = "log_probability", QuickestLayout, "straight"

    options: QuickestOptions
    bank: ImmBank

    def __init__(self, options: QuickestOptions, tracks: int, trace_rows: int = 0, threads: int = 1):
        if trace_rows:
            raise reject("trace_rows", trace_rows, "0: info describes every tick")
        super().__init__(options, tracks, trace_rows, threads)

    def largest(self) -> dict[str, int]:
        """See `Tracks.largest`."""
        modes, ticks = self.options.hypotheses, self.options.ticks
        return {
            "segment": ticks - 1, "true_mode": modes - 1, "stated_mode": modes - 1, "tick": ticks,
            "length": ticks + 1, "time": ticks, "stated_ticks": ticks,
        }  # fmt: skip

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
