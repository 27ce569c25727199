"""The row that a policy reads: its layout by name.

`core.observation_row` writes the row. `Layout` finds every quantity by name and undoes the scaling.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_env.checks import reject
from hybrid_env.core.observation_row import (
    BLOCKS,
    HYPOTHESIS_FEATURES,
    LOG_FLOOR,
    LOG_SCALE,
    SINGLES,
    TICK_SCALE,
    TRACK_FEATURES,
)

__all__ = ["HYPOTHESIS_FEATURES", "LOG_FLOOR", "LOG_SCALE", "TICK_SCALE", "TRACK_FEATURES", "Layout"]


class Layout:
    """Where each quantity stands in an observation of a bank with M hypotheses.

    >>> layout = Layout(3)
    >>> layout.width
    28
    >>> layout.read(np.zeros((5, 28), np.float32), "log_ratio").shape
    (5, 3)
    """

    def __init__(self, hypotheses: int):
        if hypotheses < 3 or hypotheses % 2 == 0:
            raise reject("hypotheses", hypotheses, "an odd number >= 3")
        self.hypotheses = hypotheses
        self.slices: dict[str, slice] = {}
        self.scales = HYPOTHESIS_FEATURES | TRACK_FEATURES
        start = 0
        for name in self.scales:
            size = hypotheses if name in HYPOTHESIS_FEATURES else 1
            self.slices[name] = slice(start, start + size)
            start += size
        self.width = start

    @classmethod
    def of_width(cls, width: int) -> "Layout":
        """The layout of observations of a given width."""
        hypotheses, rest = divmod(width - SINGLES, BLOCKS)
        if rest or hypotheses < 3 or hypotheses % 2 == 0:
            raise reject("width", width, "6 M + 10 for M = 3, 5, 7, ... hypotheses")
        return cls(hypotheses)

    @classmethod
    def of_rows(cls, observation: NDArray[Any]) -> "Layout":
        """The layout of a batch of rows, (N, width); a single row is refused."""
        if observation.ndim != 2:
            raise reject("observation shape", observation.shape, "(N, width), one row a track")
        return cls.of_width(observation.shape[1])

    def read(self, observation: NDArray[Any], name: str) -> NDArray[np.float64]:
        """A quantity in its own unit, (..., M) per hypothesis or (...) per track.

        Args:
            observation: (..., width).
            name: a key of `HYPOTHESIS_FEATURES` or `TRACK_FEATURES`.
        """
        if name not in self.slices:
            raise reject("name", name, "one of " + ", ".join(self.slices))
        values = np.asarray(observation)[..., self.slices[name]].astype(np.float64) / self.scales[name]
        return values if name in HYPOTHESIS_FEATURES else values[..., 0]
