"""Frames of an episode: the track on the left, the evidence on the right.

Each frame sets new data on the artists that change; all others are in a background image.
"""

import math
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from hybrid_env.rendering import FRAME_SIZE
from hybrid_env.rendering.evidence import TYPE_COLOURS, EvidencePanel, mode_colour, mode_name
from hybrid_env.rendering.history import ACTIVE, TRACE_INDEX, History
from hybrid_env.rendering.panels import (
    SKIPPED_STYLE,
    THRESHOLD_STYLE,
    EvidenceAxes,
    TrackAxes,
    decision_legend,
    track_legend,
)

_DPI = 100


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
        self._panels = (TrackAxes(self._track, options), EvidenceAxes(self._evidence, options, panel))
        self._title = figure.text(0.5, 0.955, "", ha="center", va="center", fontsize=10)
        self._changing: list[Artist] = [*self._panels[0].artists, *self._panels[1].artists, self._title]
        for artist in self._changing:
            artist.set_animated(True)  # excluded from the background
        self._add_legends()

    def _add_legends(self) -> None:
        """Add what is drawn, and below it the colours of the modes, by type if there are too many."""
        drawn: dict[str, Artist] = {**track_legend()}
        if not self.panel.ribbons:
            drawn |= decision_legend() | {"after the decision": Patch(**SKIPPED_STYLE)}
        self._add_legend(drawn, 0.095)
        threshold = {self.panel.legend: Line2D([], [], **THRESHOLD_STYLE)} if self.panel.legend else {}
        radii, modes = self.options.radii, range(self.options.hypotheses)
        colours = {mode_name(mode, radii): mode_colour(mode, radii) for mode in modes}
        legend = self._add_legend(_colour_legend(colours) | threshold, 0.04)
        if legend.get_window_extent().width > 0.97 * FRAME_SIZE[0]:
            legend.remove()
            names = ("straight (S)", "left turns (L), darker is tighter", "right turns (R), darker is tighter")
            colours = dict(zip(names, TYPE_COLOURS, strict=True))
            self._add_legend(_colour_legend(colours) | threshold, 0.04)

    def _add_legend(self, entries: dict[str, Any], height: float) -> Any:
        return self.figure.legend(
            list(entries.values()), list(entries), ncol=len(entries), loc="center",
            bbox_to_anchor=(0.5, height), frameon=False, fontsize=8, borderpad=0.0,
            handlelength=1.6, handletextpad=0.5, columnspacing=1.3,
        )  # fmt: skip

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
        """Episode number and axis limits (x, x, y, y, time), kept while they contain all data: a steady picture."""
        trace, ticks = history.trace, len(history.trace)
        low, high = np.empty(2), np.empty(2)
        for axis, name in enumerate("xy"):
            columns = [TRACE_INDEX[column] for column in (name, f"measured_{name}", f"estimate_{name}")]
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
        # metres per pixel, equal on both axes
        scale = max((margin * (high - low) / pixels).max(), reach / box.width)
        centre, half = 0.5 * (low + high), 0.5 * scale * pixels
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
            f"segment {history.segment + 1} of {self.options.segments}", f"tick {history.tick}", true_mode
        ]  # fmt: skip
        if history.decisions:
            last_one = history.decisions[-1]
            verdict = ("correct" if last_one.correct else "wrong") + (", forced" if last_one.forced else "")
            name = mode_name(last_one.mode, radii)
            parts.append(f"last decision {name}, {verdict}, at tick {last_one.ticks}")
        return "  |  ".join(parts)


def _colour_legend(colours: dict[str, str]) -> dict[str, Line2D]:
    return {name: Line2D([], [], color=colour, linewidth=3) for name, colour in colours.items()}
