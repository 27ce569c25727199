"""The left-hand panel of a frame: true path, measurements, estimate and decisions in the plane."""

from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.lines import Line2D

from hybrid_env.core.records import TRACE_COLUMNS
from hybrid_env.options import ModelOptions
from hybrid_env.rendering.decision_markers import DecisionMarkers
from hybrid_env.rendering.history import EpisodeHistory
from hybrid_env.rendering.modes import mode_colour
from hybrid_env.rendering.quickest_history import QuickestHistory

TRACE_INDEX = {name: index for index, name in enumerate(TRACE_COLUMNS)}
_OUTLINED: dict[str, Any] = {"linestyle": "none", "markeredgecolor": "black"}
_TRUTH_STYLE: dict[str, Any] = {"color": "#b4b4b4", "linewidth": 4}
_MEASUREMENT_STYLE: dict[str, Any] = {"color": "#8a8a8a", "marker": ".", "linestyle": "none"}
_SWITCH_STYLE: dict[str, Any] = {"color": "white", "marker": "D", "markersize": 5, **_OUTLINED}
CURRENT_COLOUR = "#f0e442"
_CURRENT_STYLE: dict[str, Any] = {"color": CURRENT_COLOUR, "marker": "*", **_OUTLINED}


class TrackAxes:
    """The artists of the track panel.

    Args:
        axes: empty axes.
        options: of the world.

    Attributes:
        artists: artists that change from frame to frame, in drawing order.
    """

    def __init__(self, axes: Any, options: ModelOptions):
        axes.set_xlabel("x [m]", fontsize=9)
        axes.set_ylabel("y [m]", fontsize=9)
        axes.set_aspect("equal", adjustable="datalim")
        (self._truth,) = axes.plot([], [], **_TRUTH_STYLE, solid_capstyle="round")
        (self._measurements,) = axes.plot([], [], **_MEASUREMENT_STYLE, markersize=2.5)
        colours = [mode_colour(mode, options.radii) for mode in range(options.hypotheses)]
        self._estimates = [axes.plot([], [], color=colour, linewidth=1.6)[0] for colour in colours]
        (self._switches,) = axes.plot([], [], **_SWITCH_STYLE)
        self._decisions = DecisionMarkers(axes, options.radii)
        (self._current,) = axes.plot([], [], **_CURRENT_STYLE, markersize=12)
        self.artists: list[Artist] = [
            self._truth, self._measurements, *self._estimates, self._switches, *self._decisions.artists,
            self._current,
        ]  # fmt: skip

    def update(self, history: EpisodeHistory | QuickestHistory) -> None:
        """Show the episode so far."""
        trace, switches = history.trace, history.switches
        column = {name: trace[:, index] for name, index in TRACE_INDEX.items()}
        self._truth.set_data(column["x"], column["y"])
        self._measurements.set_data(column["measured_x"], column["measured_y"])
        for mode, line in enumerate(self._estimates):
            active = column["active_mode"] == mode
            active[:-1] |= active[1:]  # the step into a mode has the colour of that mode
            line.set_data(np.where(active, column["estimate_x"], np.nan), column["estimate_y"])
            line.set_visible(bool(active.any()))
        self._switches.set_data(column["x"][switches], column["y"][switches])
        rows = [decision.time - 1 for decision in history.decisions]
        self._decisions.update(
            history.decisions, list(zip(column["x"][rows], column["y"][rows], strict=True))
        )
        self._current.set_data(column["x"][-1:], column["y"][-1:])


def track_legend() -> dict[str, Line2D]:
    """Return the entries of the legend with their handles."""
    return {
        "true path": Line2D([], [], **_TRUTH_STYLE),
        "measurement": Line2D([], [], **_MEASUREMENT_STYLE),
        "switch": Line2D([], [], **_SWITCH_STYLE),
        "current position": Line2D([], [], **_CURRENT_STYLE, markersize=11),
    }
