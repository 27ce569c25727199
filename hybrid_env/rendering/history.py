"""What happened in the running episode, tick by tick, for pictures and recordings."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid_env.core.records import TRACE_COLUMNS
from hybrid_env.options import WorldOptions

FloatArray = NDArray[np.float64]


class Decision(NamedTuple):
    """One decision of the episode.

    Attributes:
        time: of the episode [ticks], 1 at its first measurement.
        ratio: log-likelihood of the decided mode less that of the active one at this tick.
        mode: decided.
        true_mode: of the segment.
        correct: the judgement that the reward follows.
        forced: the segment ended undecided.
        ticks: since the switch.
        length: of the segment [ticks].
    """

    time: int
    ratio: float
    mode: int
    true_mode: int
    correct: bool
    forced: bool
    ticks: int
    length: int


class EpisodeHistory:
    """Every tick of the running episode, once.

    Attributes:
        episode: number of episodes begun.
        segment: index of the present segment.
        tick: present tick since the switch.
        true_mode: of the present segment.
        decisions: made so far in this episode.
    """

    def __init__(self, options: WorldOptions):
        self.options = options
        self.decisions: list[Decision] = []
        self.episode = 0
        self._traces: list[FloatArray] = []
        self._ratios: list[FloatArray] = []

    def begin(self, trace: FloatArray, info: dict[str, Any]) -> None:
        """Forget the last episode and note the first tick of a new one.

        Args:
            trace: (1, len(track.TRACE_COLUMNS)).
            info: of the environment's `reset`.
        """
        self.episode += 1
        self.decisions = []
        self._traces = []
        self._ratios = []
        self.add(trace, info)

    def add(self, trace: FloatArray, info: dict[str, Any]) -> None:
        """Note the ticks of one step.

        Args:
            trace: (ticks, len(track.TRACE_COLUMNS)), fast-forwarded ticks and the first of the next
                segment included.
            info: of the environment's `step`.
        """
        if "decided_mode" in info:
            self.decisions.append(
                Decision(
                    time=len(self.trace),
                    ratio=float(self.ratios[-1, info["decided_mode"]]),
                    mode=info["decided_mode"],
                    true_mode=info["decided_true_mode"],
                    correct=info["correct"],
                    forced=info["forced"],
                    ticks=info["ticks"],
                    length=info["decided_length"],
                )
            )
        self.segment, self.tick, self.true_mode = info["segment"], info["tick"], info["true_mode"]
        ratios = np.full((len(trace), self.options.hypotheses), np.nan)
        if not self.finished:  # the last tick is one that every hypothesis saw
            active = int(trace[-1, TRACE_COLUMNS.index("active_mode")])
            ratios[-1] = info["log_likelihood"] - info["log_likelihood"][active]
        self._traces.append(trace)
        self._ratios.append(ratios)

    @property
    def trace(self) -> FloatArray:
        """(T, len(track.TRACE_COLUMNS)), one row a tick."""
        return _joined(self._traces)

    @property
    def ratios(self) -> FloatArray:
        """(T, M) log-likelihood ratios to the active mode, NaN on the ticks after a decision."""
        return _joined(self._ratios)

    @property
    def switches(self) -> NDArray[np.int64]:
        """(segments so far,) rows of `trace` at which a segment begins."""
        segment = self.trace[:, TRACE_COLUMNS.index("segment")]
        return np.flatnonzero(np.diff(segment, prepend=-1.0))

    @property
    def finished(self) -> bool:
        """Whether every segment is decided."""
        return len(self.decisions) == self.options.segments


def _joined(parts: list[FloatArray]) -> FloatArray:
    """The parts as one array, which takes their place, so that reading often stays cheap."""
    if len(parts) > 1:
        parts[:] = [np.concatenate(parts)]
    return parts[0]
