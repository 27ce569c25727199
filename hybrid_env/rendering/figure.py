"""Frames of an episode: the track in the plane on the left, the evidence over time on the right.
Each frame sets new data on the artists that change; all others are in a background image. A
decision has the same marker in both panels: a circle if correct, a cross if wrong.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import Collection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator, NullLocator
from numpy.typing import NDArray

from hybrid_env.model_options import ModelOptions
from hybrid_env.rendering import FRAME_SIZE
from hybrid_env.rendering.evidence import TYPE_COLOURS, EvidencePanel, mode_colour, mode_name
from hybrid_env.rendering.history import ACTIVE, TRACE_INDEX, Decision, History

_DPI = 100
CORRECT, WRONG = "o", "X"
CURRENT_COLOUR = "#f0e442"
RIBBONS = {"true": -0.12, "stated": -0.26}
"""Height of the ribbon of true modes and of that of stated modes, below the axis of
probabilities.
"""

THRESHOLD_STYLE: dict[str, Any] = {
    "color": "#555555",
    "linestyle": "--",
    "linewidth": 1,
}
SKIPPED_STYLE: dict[str, Any] = {
    "facecolor": "black",
    "edgecolor": "none",
    "alpha": 0.07,
}
_OUTLINED: dict[str, Any] = {"linestyle": "none", "markeredgecolor": "black"}
_TRUTH_STYLE: dict[str, Any] = {"color": "#b4b4b4", "linewidth": 4}
_MEASUREMENT_STYLE: dict[str, Any] = {
    "color": "#8a8a8a",
    "marker": ".",
    "linestyle": "none",
}
_SWITCH_STYLE: dict[str, Any] = {
    "color": "white",
    "marker": "D",
    "markersize": 5,
    **_OUTLINED,
}
_CURRENT_STYLE: dict[str, Any] = {
    "color": CURRENT_COLOUR,
    "marker": "*",
    **_OUTLINED,
}


class DecisionMarkers:
    """Markers in the colour of the decided mode: one collection for correct decisions and one
    for wrong ones.
    """

    def __init__(self, axes: Any, radii: Sequence[float]):
        self.radii = radii
        self.artists = [
            axes.scatter(
                [],
                [],
                s=45,
                marker=marker,
                edgecolors="black",
                zorder=3,
                clip_on=False,
            )
            for marker in (CORRECT, WRONG)
        ]

    def update(self, decisions: Sequence[Decision], points: Sequence[tuple[float, float]]) -> None:
        """Draw each decision at its point, in the coordinates of the axes."""
        for markers, correct in zip(self.artists, (True, False), strict=True):
            chosen = [
                index for index, decision in enumerate(decisions) if decision.correct == correct
            ]
            markers.set_offsets(np.reshape([points[index] for index in chosen], (-1, 2)))
            markers.set_facecolor(
                [mode_colour(decisions[index].mode, self.radii) for index in chosen]
            )


class TrackAxes:
    """The left-hand panel: true path, measurements, estimate and decisions in the plane."""

    def __init__(self, axes: Any, options: ModelOptions):
        axes.set_xlabel("x [m]", fontsize=9)
        axes.set_ylabel("y [m]", fontsize=9)
        axes.set_aspect("equal", adjustable="datalim")
        (self._truth,) = axes.plot([], [], **_TRUTH_STYLE, solid_capstyle="round")
        (self._measurements,) = axes.plot([], [], **_MEASUREMENT_STYLE, markersize=2.5)
        self._estimates = _mode_lines(axes, options, linewidth=1.6)
        (self._switches,) = axes.plot([], [], **_SWITCH_STYLE)
        self._decisions = DecisionMarkers(axes, options.radii)
        (self._current,) = axes.plot([], [], **_CURRENT_STYLE, markersize=12)

    def update(self, history: History) -> None:
        """Show the episode so far."""
        trace, switches = history.trace, history.switches
        column = {name: trace[:, index] for name, index in TRACE_INDEX.items()}
        self._truth.set_data(column["x"], column["y"])
        self._measurements.set_data(column["measured_x"], column["measured_y"])
        for mode, line in enumerate(self._estimates):
            active = column["active_mode"] == mode
            # The step into a mode has the colour of that mode.
            active[:-1] |= active[1:]
            line.set_data(np.where(active, column["estimate_x"], np.nan), column["estimate_y"])
            line.set_visible(bool(active.any()))
        self._switches.set_data(column["x"][switches], column["y"][switches])
        rows = [decision.time - 1 for decision in history.decisions]
        self._decisions.update(
            history.decisions,
            list(zip(column["x"][rows], column["y"][rows], strict=True)),
        )
        self._current.set_data(column["x"][-1:], column["y"][-1:])


class EvidenceAxes:
    """The right-hand panel: evidence, thresholds, and decisions or ribbons of true and stated
    modes.
    """

    def __init__(self, axes: Any, options: ModelOptions, panel: EvidencePanel):
        self.axes, self.panel = axes, panel
        if panel.scale == "logit":
            axes.set_yscale("logit", nonpositive="clip")
            axes.set_yticks(*probability_ticks(panel.limits[0]))
            axes.yaxis.set_minor_locator(NullLocator())
        if panel.ribbons:
            axes.set_yticks(
                [*RIBBONS.values(), 0.0, 0.25, 0.5, 0.75, 1.0],
                [*RIBBONS, "0", "", "0.5", "", "1"],
                fontsize=8,
            )
        axes.set_ylim(panel.limits)
        axes.set_xlabel("time [ticks]", fontsize=9)
        axes.set_ylabel(panel.label, fontsize=9)
        for threshold in panel.thresholds:
            axes.annotate(
                threshold.name,
                (1.0, threshold.levels[-1]),
                (4, 0),
                xycoords=("axes fraction", "data"),
                textcoords="offset points",
                va="center",
                fontsize=9,
            )
        self._skipped = PolyCollection([], transform=axes.get_xaxis_transform(), **SKIPPED_STYLE)
        axes.add_collection(self._skipped, autolim=False)
        self._thresholds = [axes.plot([], [], **THRESHOLD_STYLE)[0] for _ in panel.thresholds]
        self._curves = {
            mode: axes.plot([], [], color=colour, linewidth=1.3)[0]
            for mode, colour in panel.colours(options.radii).items()
        }
        self._ribbons = {
            name: _mode_lines(axes, options, linewidth=9, solid_capstyle="butt")
            for name in (RIBBONS if panel.ribbons else ())
        }
        self._decisions = DecisionMarkers(axes, options.radii)

    def update(self, history: History) -> None:
        """Show the episode so far."""
        evidence, switches = history.evidence, history.switches
        # NaN separates the curves of successive segments, at whose switches the evidence begins
        # anew.
        gaps = switches[:0] if self.panel.ribbons else switches
        time = np.insert(np.arange(1.0, len(evidence) + 1.0), gaps, np.nan)
        for mode, curve in self._curves.items():
            curve.set_data(time, np.insert(evidence[:, mode], gaps, np.nan))
        ends = np.append(switches[1:], len(evidence)) + 0.5
        skipped = zip((decision.time + 0.5 for decision in history.decisions), ends, strict=False)
        self._skipped.set_verts(
            [
                [
                    (start, 0),
                    (start, 1),
                    (end, 1),
                    (end, 0),
                ]
                for start, end in skipped
            ]
        )
        self._update_thresholds(history)
        modes: dict[str, NDArray[Any]] = {
            "true": history.true_modes,
            "stated": history.trace[:, ACTIVE],
        }
        edges = np.repeat(np.arange(1.0, len(history.trace) + 1.0), 2) + np.tile(
            [-0.5, 0.5],
            len(history.trace),
        )
        for name, lines in self._ribbons.items():
            for mode, line in enumerate(lines):
                line.set_data(
                    edges,
                    np.where(np.repeat(modes[name] == mode, 2), RIBBONS[name], np.nan),
                )
        points = [
            (decision.time, np.clip(decision.evidence, *self.panel.limits))
            for decision in history.decisions
        ]
        self._decisions.update(history.decisions, points)

    def _update_thresholds(self, history: History) -> None:
        """Draw the thresholds up to the end of the axis, including the levels of the next ticks."""
        time = np.arange(self.axes.get_xlim()[1] + 1.0)
        segment = np.searchsorted(history.switches, time - 1.0, side="right").clip(1) - 1
        tick = (time - history.switches[segment]).astype(int)
        for threshold, line in zip(self.panel.thresholds, self._thresholds, strict=True):
            levels = threshold.levels[np.clip(tick - 1, 0, len(threshold.levels) - 1)]
            # A level that varies has no meaning after the decision.
            if len(threshold.levels) > 1:
                skipped = np.isnan(history.evidence).all(axis=1)
                levels[1 : len(history.evidence) + 1][skipped] = np.nan
                levels[history.switches] = np.nan
            line.set_data(time, levels)


def _mode_lines(axes: Any, options: ModelOptions, **style: Any) -> list[Line2D]:
    """Return an empty line in the colour of each mode."""
    colours = [mode_colour(mode, options.radii) for mode in range(options.hypotheses)]
    return [axes.plot([], [], color=colour, **style)[0] for colour in colours]


def probability_ticks(lowest: float) -> tuple[list[float], list[str]]:
    """Return the ticks of a logit axis and their labels, for an axis from a probability to its
    complement.
    """
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


class EpisodeFigure:
    """The matplotlib figure, `FRAME_SIZE` pixels large, with both panels and the legends."""

    def __init__(self, options: Any, panel: EvidencePanel):
        self.options, self.panel = options, panel
        width, height = FRAME_SIZE
        self.figure = figure = Figure(figsize=(width / _DPI, height / _DPI), dpi=_DPI)
        self._canvas = FigureCanvasAgg(figure)
        self._background: Any = None
        self._view: tuple[float, ...] = ()
        self._track = figure.add_axes((0.07, 0.27, 0.39, 0.64))
        self._evidence = figure.add_axes((0.57, 0.27, 0.39, 0.64))
        for axes in (self._track, self._evidence):
            axes.tick_params(labelsize=8)
            axes.xaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10]))
            axes.yaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10]))
            axes.ticklabel_format(scilimits=(-2, 4))
        self._panels = (
            TrackAxes(self._track, options),
            EvidenceAxes(self._evidence, options, panel),
        )
        self._title = figure.text(0.5, 0.955, "", ha="center", va="center", fontsize=10)
        # From frame to frame; what was added to the axes first is drawn first.
        added = [child for axes in figure.axes for child in axes.get_children()]
        self._changing = [
            *(child for child in added if isinstance(child, (Line2D, Collection))),
            self._title,
        ]
        for artist in self._changing:
            # Excluded from the background.
            artist.set_animated(True)
        self._add_legends()

    def _add_legends(self) -> None:
        """Add what is drawn, and below it the colours of the modes, by type if there are too
        many.
        """
        drawn: dict[str, Artist] = {
            "true path": Line2D([], [], **_TRUTH_STYLE),
            "measurement": Line2D([], [], **_MEASUREMENT_STYLE),
            "switch": Line2D([], [], **_SWITCH_STYLE),
            "current position": Line2D([], [], **_CURRENT_STYLE, markersize=11),
        }
        if not self.panel.ribbons:
            for name, marker in (
                ("correct decision", CORRECT),
                ("wrong decision", WRONG),
            ):
                drawn[name] = Line2D(
                    [],
                    [],
                    color="white",
                    marker=marker,
                    markersize=7,
                    **_OUTLINED,
                )
            drawn["after the decision"] = Patch(**SKIPPED_STYLE)
        self._add_legend(drawn, 0.095)
        threshold = (
            {self.panel.legend: Line2D([], [], **THRESHOLD_STYLE)} if self.panel.legend else {}
        )
        radii, modes = self.options.radii, range(self.options.hypotheses)
        colours = {mode_name(mode, radii): mode_colour(mode, radii) for mode in modes}
        legend = self._add_legend(_colour_legend(colours) | threshold, 0.04)
        if legend.get_window_extent().width > 0.97 * FRAME_SIZE[0]:
            legend.remove()
            names = (
                "straight (S)",
                "left turns (L), darker is tighter",
                "right turns (R), darker is tighter",
            )
            colours = dict(zip(names, TYPE_COLOURS, strict=True))
            self._add_legend(_colour_legend(colours) | threshold, 0.04)

    def _add_legend(self, entries: dict[str, Any], height: float) -> Any:
        return self.figure.legend(
            list(entries.values()),
            list(entries),
            ncol=len(entries),
            loc="center",
            bbox_to_anchor=(0.5, height),
            frameon=False,
            fontsize=8,
            borderpad=0.0,
            handlelength=1.6,
            handletextpad=0.5,
            columnspacing=1.3,
        )

    def draw(self, history: History) -> NDArray[np.uint8]:
        """Draw a frame, (height, width, 4) RGBA. The array is valid until the next call."""
        view = self._fit_view(history)
        if view != self._view:
            self._track.set(xlim=view[1:3], ylim=view[3:5])
            self._evidence.set(xlim=(0.0, view[5]))
            self._canvas.draw()
            self._background = self._canvas.copy_from_bbox(self.figure.bbox)
            self._view = view
        self._canvas.restore_region(self._background)
        for panel in self._panels:
            panel.update(history)
        self._title.set_text(self._title_text(history))
        for artist in self._changing:
            artist.draw(self._canvas.get_renderer())
        return np.asarray(self._canvas.buffer_rgba())

    def _fit_view(self, history: History) -> tuple[float, ...]:
        """Episode number and axis limits (x, x, y, y, time), kept while they contain all data: a
        steady picture.
        """
        trace, ticks = history.trace, len(history.trace)
        low = np.empty(2)
        high = np.empty(2)
        for axis, name in enumerate("xy"):
            columns = [
                TRACE_INDEX[column] for column in (name, f"measured_{name}", f"estimate_{name}")
            ]
            values = trace[:, columns]
            finite = values[np.isfinite(values)]
            low[axis], high[axis] = finite.min(), finite.max()
        if self._view and self._view[0] == history.episode and not history.finished:
            _, x_low, x_high, y_low, y_high, last = self._view
            inside = (low >= (x_low, y_low)) & (high <= (x_high, y_high))
            if inside.all() and ticks <= last:
                return self._view
        box = self._track.get_window_extent()
        pixels = np.array([box.width, box.height])
        reach = 0.5 * self.options.speed * self.options.tau * self.options.longest_segment
        margin = 1.1 if history.finished else 1.5
        # Metres per pixel, equal on both axes.
        scale = max((margin * (high - low) / pixels).max(), reach / box.width)
        centre = 0.5 * (low + high)
        half = 0.5 * scale * pixels
        (x_low, y_low), (x_high, y_high) = (centre - half).tolist(), (centre + half).tolist()
        step = 100 if ticks < 1000 else 1000
        last = float(ticks if history.finished else step * math.ceil(ticks / step))
        return history.episode, x_low, x_high, y_low, y_high, last

    def _title_text(self, history: History) -> str:
        radii, stated = self.options.radii, history.trace[:, ACTIVE]
        true_mode = f"true mode {mode_name(int(history.true_modes[-1]), radii)}"
        if self.panel.ribbons:
            parts = [f"tick {len(stated)}", true_mode]
            if len(stated) > 1:
                last = stated[-1] if history.finished else stated[-2]
                parts.append(f"last statement {mode_name(int(last), radii)}")
            return "  |  ".join(parts)
        parts = [
            f"segment {history.segment + 1} of {self.options.segments}",
            f"tick {history.tick}",
            true_mode,
        ]
        if history.decisions:
            last_one = history.decisions[-1]
            verdict = ("correct" if last_one.correct else "wrong") + (
                ", forced" if last_one.forced else ""
            )
            name = mode_name(last_one.mode, radii)
            parts.append(f"last decision {name}, {verdict}, at tick {last_one.ticks}")
        return "  |  ".join(parts)


def _colour_legend(colours: dict[str, str]) -> dict[str, Line2D]:
    return {name: Line2D([], [], color=colour, linewidth=3) for name, colour in colours.items()}
