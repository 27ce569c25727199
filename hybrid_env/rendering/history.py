"""Every tick of the running episode, for figures and recordings: a timeline of true modes beside
one of stated modes. A declaration is a statement that begins at its tick and holds until the next
switch.
"""

from typing import Any

import numpy as np

from hybrid_env.checks import FloatArray, Info, IntArray
from hybrid_env.core.memory import TRACE_COLUMNS
from hybrid_env.model_options import ModelOptions
from hybrid_env.rendering.evidence import EvidencePanel, probability_panel, sprt_panel


class History:
    """All ticks of the running episode, with announced or with unknown switch moments. Without a
    panel the evidence in its frames is that of the bank.
    """

    def __init__(self, options: ModelOptions, panel: EvidencePanel | None = None):
        self.options = options
        self.panel = (
            panel or (sprt_panel if options.switches == "announced" else probability_panel)()
        )
        self.episode = -1
        self.figure: Any = None
        # An empty episode, which is not counted.
        self.begin()

    def __getstate__(self) -> dict[str, Any]:
        # A figure can neither be copied nor pickled.
        return vars(self) | {"figure": None}

    def begin(self) -> None:
        """Discard the last episode; the first tick of a new one is added next."""
        self.episode += 1
        self.finished = False
        # Declarations so far: their `tick` in the episode, 1 at the first measurement, and what
        # `info` tells; none with unknown switches.
        self.decisions: list[dict[str, Any]] = []
        # Rows of `TRACE_COLUMNS` and the evidence; a stated mode is NaN before it is stated.
        self._parts: list[FloatArray] = []

    def record(self, world: Any, track: int, info: Info, finished: bool) -> None:
        """Store the last step or reset of a track of a `World` with its `info`: with announced
        switches all ticks to the next decision, of which the bank has processed the last one.
        """
        active = TRACE_COLUMNS.index("active_mode")
        rows = world.read_trace(track)
        if self.options.switches == "announced":
            likeliest = 0 if finished else int(rows[-1, active])
            evidence = info["log_likelihood"] - info["log_likelihood"][likeliest]
        else:
            # The statement of the last tick holds up to the present one, whose own comes next.
            if self._parts:
                self._parts[-1][-1, active] = rows[:, active] = world.actions[track]
            if not finished:
                rows[-1, active] = np.nan
            evidence = np.exp(info["log_probability"])
        if "decided_mode" in info:
            names = "decided_mode", "decided_true_mode", "correct", "ticks", "decided_length"
            told = {name: info[name] for name in names}
            self.decisions.append({"tick": len(self.trace), **told})
        self.finished = finished
        self.segment = info["segment"]
        self.tick = info["tick"]
        unknown = np.full((len(rows), len(evidence)), np.nan)
        self._parts.append(np.column_stack([rows, unknown]))
        if not finished:
            self.set_evidence(evidence)

    def set_evidence(self, evidence: FloatArray) -> None:
        """Replace the evidence at the current tick, (M,), one value for each hypothesis."""
        self._parts[-1][-1, len(TRACE_COLUMNS) :] = evidence

    @property
    def trace(self) -> FloatArray:
        """(T, columns) all rows so far, which are joined in place: repeated reading is cheap."""
        if len(self._parts) > 1:
            self._parts[:] = [np.concatenate(self._parts)]
        return self._parts[0]

    def column(self, name: str) -> FloatArray:
        """Return a column of `TRACE_COLUMNS`, (T,)."""
        return self.trace[:, TRACE_COLUMNS.index(name)]

    def points(self, kind: str = "") -> FloatArray:
        """Return positions, (T, 2) [m]: true ones, "measured_" or "estimate_"."""
        return np.column_stack([self.column(f"{kind}x"), self.column(f"{kind}y")])

    @property
    def stated(self) -> IntArray:
        """Declared or stated mode of each tick, (T,)."""
        return self.column("active_mode").astype(int)

    @property
    def true_modes(self) -> IntArray:
        """(T,) true modes."""
        return self.column("true_mode").astype(int)

    @property
    def evidence(self) -> FloatArray:
        """(T, M) evidence for each hypothesis, NaN at the ticks after a decision."""
        return self.trace[:, len(TRACE_COLUMNS) :]

    @property
    def drawn(self) -> IntArray:
        """Rows that a curve of the evidence goes through: it joins the moments of the decisions of
        a segment, and ends with the last one.
        """
        known = ~np.isnan(self.evidence[:, 0])
        known[self.switches[1:] - 1] = True
        return np.flatnonzero(known)

    @property
    def switches(self) -> IntArray:
        """(number of segments so far,) index of the first row of each segment."""
        return np.flatnonzero(np.diff(self.column("segment"), prepend=-1.0))
