"""Every tick of the running episode, for figures and recordings: a timeline of true modes beside
one of stated modes. A declaration is a statement that begins at its tick and holds until the next
switch.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from hybrid_env.checks import FloatArray, Info, IntArray
from hybrid_env.core.memory import TRACE_COLUMNS

TRACE_INDEX = {name: index for index, name in enumerate(TRACE_COLUMNS)}
ACTIVE, SEGMENT, TRUE_MODE = TRACE_INDEX["active_mode"], TRACE_INDEX["segment"], len(TRACE_COLUMNS)


class Decision(NamedTuple):
    """One decision of the episode: its tick, 1 at the first measurement, and the evidence for
    its mode at this tick.
    """

    time: int
    evidence: float
    mode: int
    true_mode: int
    correct: bool
    forced: bool
    ticks: int
    length: int


class History:
    """All ticks of the running episode, with announced or with unknown switch moments. `decisions`
    are the declarations so far, none with unknown switches.
    """

    def __init__(self) -> None:
        self.episode = -1
        # An empty episode, which is not counted.
        self.begin()

    def begin(self) -> None:
        """Discard the last episode; the first tick of a new one is added next."""
        self.episode += 1
        self.finished = False
        self.decisions: list[Decision] = []
        # Rows with the columns of the trace, the true mode and the evidence.
        self._parts: list[FloatArray] = []

    def record(self, world: Any, track: int, info: Info, finished: bool) -> None:
        """Store the last step or reset of a track of a `World` with its `info`."""
        if world.options.switches == "announced":
            trace = world.read_trace(track)
            active = 0 if finished else int(trace[-1, ACTIVE])
            self._add(
                trace, info["log_likelihood"] - info["log_likelihood"][active], info, finished
            )
            return
        # The statement of the last tick.
        if self._parts:
            self._parts[-1][-1, ACTIVE] = world.actions[track]
        position = info["estimate"][[0, 2]]
        row = [*info["truth"], *info["measurement"], *position, np.nan, info["segment"]]
        self._add([] if finished else [row], np.exp(info["log_probability"]), info, finished)

    def _add(
        self,
        trace: Sequence[ArrayLike] | FloatArray,
        evidence: FloatArray,
        info: Info,
        finished: bool,
    ) -> None:
        """Store the ticks of one step, (ticks, len(TRACE_COLUMNS)), with those skipped after a
        decision and the first tick of the next segment, none if the step ends the episode;
        evidence: (M,) at the current tick.
        """
        if "decided_mode" in info:
            value = float(self.evidence[-1, info["decided_mode"]])
            names = (
                "decided_mode",
                "decided_true_mode",
                "correct",
                "forced",
                "ticks",
                "decided_length",
            )
            self.decisions.append(Decision(len(self.trace), value, *(info[name] for name in names)))
        self.finished = finished
        self.segment = info["segment"]
        self.tick = info["tick"]
        rows = np.reshape(np.asarray(trace, float), (-1, len(TRACE_COLUMNS)))
        current = rows[:, SEGMENT] == info["segment"]
        true = np.where(
            current,
            info["true_mode"],
            info.get("decided_true_mode", info["true_mode"]),
        )
        self._parts.append(
            np.column_stack([rows, true, np.full((len(rows), len(evidence)), np.nan)])
        )
        # Only the last tick was processed by every filter of the bank.
        if not finished:
            self.set_evidence(evidence)

    @property
    def stated(self) -> IntArray:
        """Declared or stated mode of each tick, (ticks,)."""
        return self.trace[:, ACTIVE].astype(int)

    def set_evidence(self, evidence: FloatArray) -> None:
        """Replace the evidence at the current tick, (M,), one value for each hypothesis."""
        self._parts[-1][-1, TRUE_MODE + 1 :] = evidence

    @property
    def _rows(self) -> FloatArray:
        """All rows so far, which are joined in place, so that repeated reading is cheap."""
        if len(self._parts) > 1:
            self._parts[:] = [np.concatenate(self._parts)]
        return self._parts[0]

    @property
    def trace(self) -> FloatArray:
        """(T, len(TRACE_COLUMNS)); with unknown switches the active mode is the stated one, NaN
        before it is.
        """
        return self._rows[:, :TRUE_MODE]

    @property
    def true_modes(self) -> IntArray:
        """(T,) true modes."""
        return self._rows[:, TRUE_MODE].astype(int)

    @property
    def evidence(self) -> FloatArray:
        """(T, M) evidence for each hypothesis, NaN at the ticks after a decision."""
        return self._rows[:, TRUE_MODE + 1 :]

    @property
    def switches(self) -> IntArray:
        """(number of segments so far,) index of the first row of `trace` of each segment."""
        return np.flatnonzero(np.diff(self.trace[:, SEGMENT], prepend=-1.0))
