"""Every tick of the running episode, for figures and recordings."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid_env.core.records import TRACE_COLUMNS
from hybrid_env.options import WorldOptions

FloatArray = NDArray[np.float64]


class Decision(NamedTuple):
    """One decision of the episode.

    Attributes:
        time: tick of the episode, 1 at its first measurement.
        evidence: for the decided mode at this tick.
        mode: decided mode.
        true_mode: true mode of the segment.
        correct: whether the reward counts the decision as correct.
        forced: whether the segment ended before the agent declared a mode.
        ticks: number of ticks since the switch.
        length: length of the segment [ticks].
    """

    time: int
    evidence: float
    mode: int
    true_mode: int
    correct: bool
    forced: bool
    ticks: int
    length: int


class EpisodeHistory:
    """All ticks and decisions of the running episode.

    Attributes:
        episode: number of episodes started.
        segment: index of the current segment.
        tick: current tick since the switch.
        true_mode: true mode of the current segment.
        decisions: decisions made so far in this episode.
    """

    def __init__(self, options: WorldOptions):
        self.options = options
        self.decisions: list[Decision] = []
        self.episode = 0
        self._traces: list[FloatArray] = []
        self._evidence: list[FloatArray] = []

    def begin(self, trace: FloatArray, info: dict[str, Any]) -> None:
        """Discard the last episode and store the first tick of a new one.

        Args:
            trace: (1, len(TRACE_COLUMNS)).
            info: returned by `reset` of the environment.
        """
        self.episode += 1
        self.decisions = []
        self._traces = []
        self._evidence = []
        self.add(trace, info)

    def add(self, trace: FloatArray, info: dict[str, Any]) -> None:
        """Store the ticks of one step.

        The evidence at the current tick is the log-likelihood ratio of each hypothesis to the active mode,
        unless `set_evidence` replaces it.

        Args:
            trace: (ticks, len(TRACE_COLUMNS)), including the skipped ticks after a decision and the first
                tick of the next segment.
            info: returned by `step` of the environment.
        """
        if "decided_mode" in info:
            self.decisions.append(
                Decision(
                    time=len(self.trace),
                    evidence=float(self.evidence[-1, info["decided_mode"]]),
                    mode=info["decided_mode"],
                    true_mode=info["decided_true_mode"],
                    correct=info["correct"],
                    forced=info["forced"],
                    ticks=info["ticks"],
                    length=info["decided_length"],
                )
            )
        self.segment, self.tick, self.true_mode = info["segment"], info["tick"], info["true_mode"]
        evidence = np.full((len(trace), self.options.hypotheses), np.nan)
        if not self.finished:  # only the last tick was processed by every filter of the bank
            active = int(trace[-1, TRACE_COLUMNS.index("active_mode")])
            evidence[-1] = info["log_likelihood"] - info["log_likelihood"][active]
        self._traces.append(trace)
        self._evidence.append(evidence)

    def set_evidence(self, evidence: FloatArray) -> None:
        """Replace the evidence at the current tick, (M,), one value for each hypothesis."""
        self._evidence[-1][-1] = evidence

    @property
    def trace(self) -> FloatArray:
        """(T, len(TRACE_COLUMNS)), one row for each tick."""
        return _joined(self._traces)

    @property
    def evidence(self) -> FloatArray:
        """(T, M) evidence for each hypothesis, NaN at the ticks after a decision."""
        return _joined(self._evidence)

    @property
    def switches(self) -> NDArray[np.int64]:
        """(number of segments so far,) index of the first row of `trace` of each segment."""
        segment = self.trace[:, TRACE_COLUMNS.index("segment")]
        return np.flatnonzero(np.diff(segment, prepend=-1.0))

    @property
    def finished(self) -> bool:
        """Whether every segment is decided."""
        return len(self.decisions) == self.options.segments


def _joined(parts: list[FloatArray]) -> FloatArray:
    """Concatenate the parts and store the result in place of them, so that repeated reading is cheap."""
    if len(parts) > 1:
        parts[:] = [np.concatenate(parts)]
    return parts[0]
