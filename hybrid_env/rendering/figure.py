"""Frames of an episode: the track in the plane on the left, the evidence over time on the right.
Each frame sets new data on the artists that change; all others are in a background image. A
decision has the same marker in both panels: a circle if correct, a cross if wrong.
"""

import math
from collections.abc import Sequence
from itertools import compress
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import Collection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogitFormatter, LogitLocator, MaxNLocator, NullLocator
from numpy.typing import NDArray

from hybrid_env.model_options import ModelOptions
from hybrid_env.rendering import FRAME_SIZE
from hybrid_env.rendering.evidence import TYPE_COLOURS, EvidencePanel, mode_colour, mode_name
from hybrid_env.rendering.history import ACTIVE, TRACE_INDEX, Decision, History

RIBBONS = {"true": -0.12, "stated": -0.26}
"""Height of the ribbon of true modes and of that of stated modes, below the axis of
probabilities.
"""


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
                facecolors="white",
                edgecolors="black",
                zorder=3,
                clip_on=False,
                label=f"{name} decision",
            )
            for name, marker in (("correct", "o"), ("wrong", "X"))
        ]

    def update(self, decisions: Sequence[Decision], points: Sequence[tuple[float, float]]) -> None:
        """Draw each decision at its point, in the coordinates of the axes."""
        for markers, correct in zip(self.artists, (True, False), strict=True):
            chosen = [decision.correct == correct for decision in decisions]
            markers.set_offsets(np.reshape([*compress(points, chosen)], (-1, 2)))
            markers.set_facecolor(
                [mode_colour(decision.mode, self.radii) for decision in compress(decisions, chosen)]
            )


class TrackAxes:
    """The left-hand panel: true path, measurements, estimate and decisions in the plane."""

    def __init__(self, axes: Any, options: ModelOptions):
        axes.set_xlabel("x [m]", fontsize=9)
        axes.set_ylabel("y [m]", fontsize=9)
        axes.set_aspect("equal", adjustable="datalim")
        (self._truth,) = axes.plot([], [], color="#b4b4b4", linewidth=4, label="true path")
        (self._measurements,) = axes.plot(
            [],
            [],
            ".",
            color="#8a8a8a",
            markersize=2.5,
            label="measurement",
        )
        self._estimates = _mode_lines(axes, options, linewidth=1.6)
        (self._switches,) = axes.plot(
            [],
            [],
            "D",
            color="white",
            markersize=5,
            markeredgecolor="black",
            label="switch",
        )
        self._decisions = DecisionMarkers(axes, options.radii)
        (self._current,) = axes.plot(
            [],
            [],
            "*",
            color="#f0e442",
            markersize=12,
            markeredgecolor="black",
            label="current position",
        )
        self.named = [self._truth, self._measurements, self._switches, self._current]

    def update(self, history: History) -> None:
        """Show the episode so far."""
        trace = history.trace
        switches = history.switches
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
        self.panel = panel
        if panel.scale == "logit":
            axes.set_yscale("logit", nonpositive="clip")
            axes.yaxis.set_major_locator(LogitLocator(nbins=7))
            axes.yaxis.set_major_formatter(LogitFormatter(one_half="0.5"))
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
        for name, level in panel.thresholds.items():
            axes.annotate(
                name,
                (1.0, level),
                (4, 0),
                xycoords=("axes fraction", "data"),
                textcoords="offset points",
                va="center",
                fontsize=9,
            )
        self._skipped = PolyCollection(
            [],
            transform=axes.get_xaxis_transform(),
            facecolor="black",
            edgecolor="none",
            alpha=0.07,
            label="after the decision",
        )
        axes.add_collection(self._skipped, autolim=False)
        thresholds = [
            axes.axhline(level, linestyle="--", color="#555555", linewidth=1, label=panel.legend)
            for level in panel.thresholds.values()
        ]
        self._curves = {
            mode: axes.plot([], [], color=colour, linewidth=1.3)[0]
            for mode, colour in panel.colours(options.radii).items()
        }
        self._ribbons = {
            name: _mode_lines(axes, options, linewidth=9, solid_capstyle="butt")
            for name in (RIBBONS if panel.ribbons else ())
        }
        self._decisions = DecisionMarkers(axes, options.radii)
        self.named = [] if panel.ribbons else [*self._decisions.artists, self._skipped]
        self.levels = thresholds[:1] if panel.legend else []

    def update(self, history: History) -> None:
        """Show the episode so far."""
        evidence = history.evidence
        switches = history.switches
        # NaN separates the curves of successive segments, at whose switches the evidence begins
        # anew.
        gaps = switches[:0] if self.panel.ribbons else switches
        time = np.insert(np.arange(1.0, len(evidence) + 1.0), gaps, np.nan)
        for mode, curve in self._curves.items():
            curve.set_data(time, np.insert(evidence[:, mode], gaps, np.nan))
        ends = np.append(switches[1:], len(evidence)) + 0.5
        skipped = zip((decision.time + 0.5 for decision in history.decisions), ends, strict=False)
        self._skipped.set_verts(
            [list(zip(np.repeat(interval, 2), (0, 1, 1, 0), strict=True)) for interval in skipped]
        )
        modes = {"true": history.true_modes, "stated": history.trace[:, ACTIVE]}
        edges = np.add.outer(np.arange(1.0, len(history.trace) + 1.0), [-0.5, 0.5]).ravel()
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


def _mode_lines(axes: Any, options: ModelOptions, **style: Any) -> list[Line2D]:
    """Return an empty line in the colour of each mode."""
    return [
        axes.plot([], [], color=mode_colour(mode, options.radii), **style)[0]
        for mode in range(options.hypotheses)
    ]


class EpisodeFigure:
    """The matplotlib figure, `FRAME_SIZE` pixels large, with both panels and the legends."""

    def __init__(self, options: Any, panel: EvidencePanel):
        self.options = options
        self.panel = panel
        width, height = FRAME_SIZE
        self.figure = figure = Figure(figsize=(width / 100, height / 100), dpi=100)
        self._canvas = FigureCanvasAgg(figure)
        self._background: Any = None
        self._view: tuple[float, ...] = ()
        self._track = figure.add_axes((0.07, 0.27, 0.39, 0.64))
        self._evidence = figure.add_axes((0.57, 0.27, 0.39, 0.64))
        for axes in figure.axes:
            axes.tick_params(labelsize=8)
            for axis in (axes.xaxis, axes.yaxis):
                axis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10]))
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
        track, evidence = self._panels
        radii = self.options.radii
        modes = range(self.options.hypotheses)
        colours = {mode_name(mode, radii): mode_colour(mode, radii) for mode in modes}
        if len(colours) > 9:
            names = (
                "straight (S)",
                "left turns (L), darker is tighter",
                "right turns (R), darker is tighter",
            )
            colours = dict(zip(names, TYPE_COLOURS, strict=True))
        lines = [
            Line2D([], [], color=colour, linewidth=3, label=name)
            for name, colour in colours.items()
        ]
        rows = {0.095: [*track.named, *evidence.named], 0.04: [*lines, *evidence.levels]}
        for height, artists in rows.items():
            self.figure.legend(
                handles=artists,
                ncol=len(artists),
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
        trace = history.trace
        ticks = len(history.trace)
        kinds = ("", "measured_", "estimate_")
        columns = [[TRACE_INDEX[kind + axis] for axis in "xy"] for kind in kinds]
        # (ticks, kinds, axes), NaN where there is no measurement.
        values = trace[:, columns]
        low = np.nanmin(values, axis=(0, 1))
        high = np.nanmax(values, axis=(0, 1))
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
        radii = self.options.radii
        stated = history.trace[:, ACTIVE]
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
            decision = history.decisions[-1]
            verdict = "correct" if decision.correct else "wrong"
            verdict += ", forced" if decision.forced else ""
            name = mode_name(decision.mode, radii)
            parts.append(f"last decision {name}, {verdict}, at tick {decision.ticks}")
        return "  |  ".join(parts)
