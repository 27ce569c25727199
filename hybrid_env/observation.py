"""The layout of an observation, by name.

`core.observation_row` writes the observation. `Layout` locates each quantity by name and removes its scale.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_env.checks import check_integer, reject
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
    """Position and scale of each quantity in an observation of a bank with M hypotheses.

    >>> layout = Layout(3)
    >>> layout.width
    28
    >>> layout.read(np.zeros((5, 28), np.float32), "log_ratio").shape
    (5, 3)
    """

    def __init__(self, hypotheses: int):
        self.hypotheses = check_integer("hypotheses", hypotheses, minimum=3)
        if self.hypotheses % 2 == 0:
            raise reject("hypotheses", hypotheses, "an odd number >= 3")
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
        """Return the layout of observations of a given width. Raises `ArgumentError` if there is none."""
        hypotheses, rest = divmod(width - SINGLES, BLOCKS)
        if rest or hypotheses < 3 or hypotheses % 2 == 0:
            raise reject("width", width, "6 M + 10 for M = 3, 5, 7, ... hypotheses")
        return cls(hypotheses)

    @classmethod
    def of_rows(cls, observation: NDArray[Any]) -> "Layout":
        """Return the layout of a batch of observations, (N, width). Raises `ArgumentError` otherwise."""
        if observation.ndim != 2:
            raise reject("observation shape", observation.shape, "(N, width), one row per track")
        return cls.of_width(observation.shape[1])

    def read(self, observation: NDArray[Any], name: str) -> NDArray[np.float64]:
        """Return a quantity without its scale, (..., M) per hypothesis or (...) per track.

        Args:
            observation: one or more observations, (..., width).
            name: a key of `HYPOTHESIS_FEATURES` or `TRACK_FEATURES`.
        """
        if name not in self.slices:
            raise reject("name", name, "one of " + ", ".join(self.slices))
        rows = np.asarray(observation)
        if rows.ndim == 0 or rows.shape[-1] != self.width:
            raise reject("observation shape", rows.shape, f"(..., {self.width})")
        values = rows[..., self.slices[name]].astype(np.float64) / self.scales[name]
        return values if name in HYPOTHESIS_FEATURES else values[..., 0]
