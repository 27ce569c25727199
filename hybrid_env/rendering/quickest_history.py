"""Every tick of the running episode with unknown switch moments, for figures."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_env.core.records import TRACE_COLUMNS
from hybrid_env.rendering.history import Decision

ACTIVE, SEGMENT = TRACE_COLUMNS.index("active_mode"), TRACE_COLUMNS.index("segment")


class QuickestHistory:
    """All ticks and statements of the running episode.

    Attributes:
        episode: number of episodes started.
        finished: whether the episode has ended.
        decisions: empty; a statement is no decision.
    """

    def __init__(self) -> None:
        self.episode = 0
        self.finished = False
        self.decisions: tuple[Decision, ...] = ()
        self._rows: list[list[float]] = []
        self._modes: list[int] = []
        self._probabilities: list[NDArray[np.float64]] = []

    def begin(self, info: dict[str, Any]) -> None:
        """Discard the last episode and store the first tick of a new one. info: returned by `reset`."""
        self.episode += 1
        self.finished = False
        self._rows, self._modes, self._probabilities = [], [], []
        self._add_tick(info)

    def add(self, stated: int, info: dict[str, Any], finished: bool) -> None:
        """Store the statement of the last tick, and the next tick unless the episode is finished.

        Args:
            stated: stated mode.
            info: returned by `step`.
            finished: whether the episode has ended.
        """
        self._rows[-1][ACTIVE] = stated
        self.finished = finished
        if not finished:
            self._add_tick(info)

    def _add_tick(self, info: dict[str, Any]) -> None:
        row = [*info["truth"], *info["measurement"], *info["estimate"][[0, 2]], np.nan, info["segment"]]
        self._rows.append([float(value) for value in row])
        self._modes.append(info["true_mode"])
        self._probabilities.append(np.exp(info["log_probability"]))

    def set_evidence(self, probabilities: NDArray[np.float64]) -> None:
        """Replace the probabilities of the modes at the current tick, (M,)."""
        self._probabilities[-1] = probabilities

    @property
    def trace(self) -> NDArray[np.float64]:
        """(T, len(TRACE_COLUMNS)), one row for each tick; the active mode is the stated one, at first NaN."""
        return np.array(self._rows)

    @property
    def true_modes(self) -> NDArray[np.int64]:
        """(T,) true modes."""
        return np.array(self._modes)

    @property
    def probabilities(self) -> NDArray[np.float64]:
        """(T, M) probabilities of the modes, of the bank unless `set_evidence` replaces them."""
        return np.array(self._probabilities)

    @property
    def switches(self) -> NDArray[np.int64]:
        """Indices of the first tick of each segment."""
        return np.flatnonzero(np.diff(self.trace[:, SEGMENT], prepend=-1.0))
