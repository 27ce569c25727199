"""The right-hand panel of a frame: the evidence over time, with thresholds and decisions."""

import math
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.collections import PolyCollection
from matplotlib.ticker import NullLocator

from hybrid_env.options import WorldOptions
from hybrid_env.rendering.decision_markers import DecisionMarkers
from hybrid_env.rendering.evidence import EvidencePanel
from hybrid_env.rendering.history import EpisodeHistory

THRESHOLD_STYLE: dict[str, Any] = {"color": "#555555", "linestyle": "--", "linewidth": 1}
SKIPPED_STYLE: dict[str, Any] = {"facecolor": "black", "edgecolor": "none", "alpha": 0.07}


class EvidenceAxes:
    """The artists of the evidence panel.

    Args:
        axes: empty axes.
        options: of the world.
        panel: what to show.

    Attributes:
        artists: artists that change from frame to frame, in drawing order.
    """

    def __init__(self, axes: Any, options: WorldOptions, panel: EvidencePanel):
        self.axes, self.panel = axes, panel
        if panel.scale == "logit":
            axes.set_yscale("logit", nonpositive="clip")
            axes.set_yticks(*probability_ticks(panel.limits[0]))
            axes.yaxis.set_minor_locator(NullLocator())
        axes.set_ylim(panel.limits)
        axes.set_xlabel("time [ticks]", fontsize=9)
        axes.set_ylabel(panel.label, fontsize=9)
        for threshold in panel.thresholds:
            axes.annotate(
                threshold.name, (1.0, threshold.levels[-1]), (4, 0), xycoords=("axes fraction", "data"),
                textcoords="offset points", va="center", fontsize=9,
            )  # fmt: skip
        self._skipped = PolyCollection([], transform=axes.get_xaxis_transform(), **SKIPPED_STYLE)
        axes.add_collection(self._skipped, autolim=False)
        self._thresholds = [axes.plot([], [], **THRESHOLD_STYLE)[0] for _ in panel.thresholds]
        self._curves = {
            mode: axes.plot([], [], color=colour, linewidth=1.3)[0]
            for mode, colour in panel.colours(options.radii).items()
        }
        self._decisions = DecisionMarkers(axes, options.radii)
        self.artists: list[Artist] = [
            self._skipped, *self._thresholds, *self._curves.values(), *self._decisions.artists,
        ]  # fmt: skip

    def update(self, history: EpisodeHistory) -> None:
        """Show the episode so far."""
        evidence, switches = history.evidence, history.switches
        # NaN at each switch separates the curves of successive segments
        time = np.insert(np.arange(1.0, len(evidence) + 1.0), switches, np.nan)
        for mode, curve in self._curves.items():
            curve.set_data(time, np.insert(evidence[:, mode], switches, np.nan))
        ends = np.append(switches[1:], len(evidence)) + 0.5
        skipped = zip((decision.time + 0.5 for decision in history.decisions), ends, strict=False)
        self._skipped.set_verts([[(start, 0), (start, 1), (end, 1), (end, 0)] for start, end in skipped])
        self._update_thresholds(history)
        points = [
            (decision.time, np.clip(decision.evidence, *self.panel.limits)) for decision in history.decisions
        ]
        self._decisions.update(history.decisions, points)

    def _update_thresholds(self, history: EpisodeHistory) -> None:
        """Draw the thresholds up to the end of the axis, including the levels of the next ticks."""
        time = np.arange(self.axes.get_xlim()[1] + 1.0)
        segment = np.searchsorted(history.switches, time - 1.0, side="right").clip(1) - 1
        tick = (time - history.switches[segment]).astype(int)
        for threshold, line in zip(self.panel.thresholds, self._thresholds, strict=True):
            levels = threshold.levels[np.clip(tick - 1, 0, len(threshold.levels) - 1)]
            if len(threshold.levels) > 1:  # a level that varies has no meaning after the decision
                skipped = np.isnan(history.evidence).all(axis=1)
                levels[1 : len(history.evidence) + 1][skipped] = np.nan
                levels[history.switches] = np.nan
            line.set_data(time, levels)


def probability_ticks(lowest: float) -> tuple[list[float], list[str]]:
    """Return the ticks of a logit axis and their labels, for an axis from a probability to its complement."""
    largest = math.floor(round(-math.log10(lowest), 6))
    step = math.ceil(largest / 3)
    powers = range(step, largest + 1, step)
    labels = {0.5: "50 %"}
    for power in powers:
        percent = 10.0 ** (2 - power)
        short = power <= 6
        labels[10.0**-power] = f"{percent:g} %" if short else f"$10^{{-{power}}}$"
        labels[1.0 - 10.0**-power] = f"{100.0 - percent:g} %" if short else f"$1 - 10^{{-{power}}}$"
    return list(labels), list(labels.values())
