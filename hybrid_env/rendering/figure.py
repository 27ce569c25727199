"""Pictures of an episode: the track, and the evidence for each hypothesis against the active one.

The figure is built once. A frame only gives new data to its artists; what stays is painted once into a
background, anew only when the limits of the axes change.
"""

import math
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from hybrid_env.core.records import TRACE_COLUMNS
from hybrid_env.options import WorldOptions
from hybrid_env.rendering.history import EpisodeHistory
from hybrid_env.rendering.modes import TYPE_COLOURS, mode_colour, mode_name
from hybrid_env.rendering.window import Window

RENDER_FPS = 10
FRAME_SIZE = (900, 450)  # width, height [px]


ERROR_PROBABILITY = 0.001  # a = b of the thresholds that are drawn
THRESHOLD = math.log((1.0 - ERROR_PROBABILITY) / ERROR_PROBABILITY)  # A, and -B for a = b
RATIO_LIMIT = 15.0

_DPI = 100
_TRUTH, _MEASURED, _NOW, _THRESHOLD = "#b4b4b4", "#8a8a8a", "#f0e442", "#555555"
_SKIPPED: dict[str, Any] = {"facecolor": "black", "edgecolor": "none", "alpha": 0.07}
_COLUMN = {name: index for index, name in enumerate(TRACE_COLUMNS)}


class Renderer:
    """Draws an episode, frame by frame.

    Args:
        options: of the world.
        human: True shows frames in a window, False returns them.
    """

    def __init__(self, options: WorldOptions, human: bool):
        self.options = options
        self.window = Window(RENDER_FPS) if human else None
        self._figure: EpisodeFigure | None = None

    def __getstate__(self) -> dict[str, Any]:
        window = None if self.window is None else Window(self.window.fps)
        return self.__dict__ | {"window": window, "_figure": None}  # neither can be copied or pickled

    def draw(self, history: EpisodeHistory) -> NDArray[np.uint8] | None:
        """One frame of the episode so far.

        Returns:
            (height, width, 3) uint8, a fresh array; None where frames go to a window. Once the user has
            closed the window this does nothing, and the caller's loop goes on unwatched.

        Raises:
            NoDisplayError: SDL cannot open a window.
        """
        if self.window is not None and not self.window.wants_frame(FRAME_SIZE):
            return None
        if self._figure is None:
            self._figure = EpisodeFigure(self.options)
        frame = self._figure.paint(history)
        if self.window is None:
            return np.array(frame[..., :3])
        self.window.show(frame)
        return None

    def close(self) -> None:
        """Close the window, if there is one; the next `draw` opens another."""
        if self.window is not None:
            self.window.close()


class EpisodeFigure:
    """The two panels.

    Args:
        options: of the world.

    Attributes:
        figure: FRAME_SIZE pixels large.
    """

    def __init__(self, options: WorldOptions):
        self.options = options
        width, height = FRAME_SIZE
        self.figure = figure = Figure(figsize=(width / _DPI, height / _DPI), dpi=_DPI)
        self._canvas = FigureCanvasAgg(figure)
        self._background: Any = None
        self._view: tuple[float, ...] = ()
        self._track = figure.add_axes((0.075, 0.27, 0.40, 0.64))
        self._track.set_xlabel("x [m]", fontsize=9)
        self._track.set_ylabel("y [m]", fontsize=9)
        self._track.set_aspect("equal", adjustable="datalim")
        self._evidence = figure.add_axes((0.565, 0.27, 0.40, 0.64))
        self._evidence.set_xlabel("time [ticks]", fontsize=9)
        self._evidence.set_ylabel("log-likelihood ratio to the active mode", fontsize=9)
        self._evidence.set_ylim(-RATIO_LIMIT, RATIO_LIMIT)
        for axes in (self._track, self._evidence):
            axes.tick_params(labelsize=8)
            axes.xaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10]))
            axes.yaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10]))
            axes.ticklabel_format(scilimits=(-2, 4))
        for level, name in ((THRESHOLD, "A"), (-THRESHOLD, "B")):
            self._evidence.axhline(level, color=_THRESHOLD, linestyle="--", linewidth=1)
            self._evidence.annotate(
                name, (1.0, level), (4, 0), xycoords=("axes fraction", "data"),
                textcoords="offset points", va="center", fontsize=9,
            )  # fmt: skip

        colours = [mode_colour(mode, options.radii) for mode in range(options.hypotheses)]
        outlined: dict[str, Any] = {"linestyle": "none", "markeredgecolor": "black"}
        (self._truth,) = self._track.plot([], [], color=_TRUTH, linewidth=4, solid_capstyle="round")
        (self._measured,) = self._track.plot([], [], ".", color=_MEASURED, markersize=2.5)
        self._estimates = [self._track.plot([], [], color=colour, linewidth=1.6)[0] for colour in colours]
        (self._switched,) = self._track.plot([], [], "D", color="white", markersize=5, **outlined)
        (self._here,) = self._track.plot([], [], "*", color=_NOW, markersize=12, **outlined)
        self._skipped = PolyCollection([], **_SKIPPED)
        self._evidence.add_collection(self._skipped, autolim=False)
        self._ratios = [self._evidence.plot([], [], color=colour, linewidth=1.3)[0] for colour in colours]
        self._correct, self._wrong = (
            self._evidence.scatter([], [], s=70, marker=marker, edgecolors="black", zorder=3)
            for marker in ("o", "X")
        )
        self._title = figure.text(0.5, 0.955, "", ha="center", va="center", fontsize=10)
        self._moving: list[Artist] = [
            self._truth, self._measured, *self._estimates, self._switched, self._here,
            self._skipped, *self._ratios, self._correct, self._wrong, self._title,
        ]  # fmt: skip
        for artist in self._moving:
            artist.set_animated(True)  # left out of the background

        self._add_legend(
            {
                "true path": Line2D([], [], color=_TRUTH, linewidth=4),
                "measured": Line2D([], [], color=_MEASURED, marker=".", linestyle="none"),
                "switch": Line2D([], [], color="white", marker="D", markersize=5, **outlined),
                "now": Line2D([], [], color=_NOW, marker="*", markersize=11, **outlined),
                "correct decision": Line2D([], [], color="white", marker="o", markersize=7, **outlined),
                "wrong decision": Line2D([], [], color="white", marker="X", markersize=7, **outlined),
                "A, B at alpha = 0.001": Line2D([], [], color=_THRESHOLD, linestyle="--", linewidth=1),
                "after the decision": Patch(**_SKIPPED),
            },
            0.095,
        )
        lines = [Line2D([], [], color=colour, linewidth=3) for colour in colours]
        names = [mode_name(mode, options.radii) for mode in range(options.hypotheses)]
        modes = self._add_legend(dict(zip(names, lines, strict=True)), 0.04)
        if modes.get_window_extent().width > 0.97 * width:
            modes.remove()
            lines = [Line2D([], [], color=colour, linewidth=3) for colour in TYPE_COLOURS]
            types = (
                "straight (S)",
                "left turns (L), darker is tighter",
                "right turns (R), darker is tighter",
            )
            self._add_legend(dict(zip(types, lines, strict=True)), 0.04)

    def _add_legend(self, entries: dict[str, Any], height: float) -> Any:
        return self.figure.legend(
            list(entries.values()), list(entries), ncol=len(entries), loc="center",
            bbox_to_anchor=(0.5, height), frameon=False, fontsize=8, borderpad=0.0,
            handlelength=1.6, handletextpad=0.5, columnspacing=1.3,
        )  # fmt: skip

    def paint(self, history: EpisodeHistory) -> NDArray[np.uint8]:
        """The pixels of a frame, (height, width, 4) RGBA, valid until the next one."""
        view = self._fit_view(history)
        if view != self._view:
            self._track.set(xlim=view[1:3], ylim=view[3:5])
            self._evidence.set(xlim=(0.0, view[5]))
            self._canvas.draw()
            self._background = self._canvas.copy_from_bbox(self.figure.bbox)
            self._view = view
        self._canvas.restore_region(self._background)
        self._update_track(history)
        self._update_evidence(history)
        self._title.set_text(self._title_text(history))
        for artist in self._moving:
            artist.draw(self._canvas.get_renderer())
        return np.asarray(self._canvas.buffer_rgba())

    def _fit_view(self, history: EpisodeHistory) -> tuple[float, ...]:
        """Episode and limits (x, x, y, y, time), left alone while they hold all data, for steady frames."""
        trace, ticks = history.trace, len(history.trace)
        low, high = np.empty(2), np.empty(2)
        for axis, name in enumerate("xy"):
            values = trace[:, [_COLUMN[name], _COLUMN[f"measured_{name}"], _COLUMN[f"estimate_{name}"]]]
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
        # metres a pixel, equal on both axes
        scale = max((margin * (high - low) / pixels).max(), reach / box.width)
        centre, half = 0.5 * (low + high), 0.5 * scale * pixels
        (x_low, y_low), (x_high, y_high) = (centre - half).tolist(), (centre + half).tolist()
        step = 100 if ticks < 1000 else 1000
        last = float(ticks if history.finished else step * math.ceil(ticks / step))
        return history.episode, x_low, x_high, y_low, y_high, last

    def _update_track(self, history: EpisodeHistory) -> None:
        trace, switches = history.trace, history.switches
        column = {name: trace[:, index] for name, index in _COLUMN.items()}
        self._truth.set_data(column["x"], column["y"])
        self._measured.set_data(column["measured_x"], column["measured_y"])
        for mode, line in enumerate(self._estimates):
            own = column["active_mode"] == mode
            own[:-1] |= own[1:]  # the step into a mode has its colour
            line.set_data(np.where(own, column["estimate_x"], np.nan), column["estimate_y"])
            line.set_visible(bool(own.any()))
        self._switched.set_data(column["x"][switches], column["y"][switches])
        self._here.set_data(column["x"][-1:], column["y"][-1:])

    def _update_evidence(self, history: EpisodeHistory) -> None:
        ratios, switches = history.ratios, history.switches
        # a line must not run from one segment into the next
        time = np.insert(np.arange(1.0, len(ratios) + 1.0), switches, np.nan)
        for mode, line in enumerate(self._ratios):
            line.set_data(time, np.insert(ratios[:, mode], switches, np.nan))
        ends = np.append(switches[1:], len(ratios)) + 0.5
        skipped = zip((decision.time + 0.5 for decision in history.decisions), ends, strict=False)
        self._skipped.set_verts(
            [[(start, -99.0), (start, 99.0), (end, 99.0), (end, -99.0)] for start, end in skipped]
        )
        edge = RATIO_LIMIT - 1.0
        for markers, correct in ((self._correct, True), (self._wrong, False)):
            made = [decision for decision in history.decisions if decision.correct == correct]
            points = [(decision.time, min(max(decision.ratio, -edge), edge)) for decision in made]
            markers.set_offsets(np.reshape(points, (-1, 2)))
            markers.set_facecolor([mode_colour(decision.mode, self.options.radii) for decision in made])

    def _title_text(self, history: EpisodeHistory) -> str:
        parts = [
            f"segment {history.segment + 1} of {self.options.segments}",
            f"tick {history.tick}",
            f"true mode {mode_name(history.true_mode, self.options.radii)}",
        ]
        if history.decisions:
            last = history.decisions[-1]
            verdict = ("correct" if last.correct else "wrong") + (", forced" if last.forced else "")
            name = mode_name(last.mode, self.options.radii)
            parts.append(f"last decision {name}, {verdict}, at tick {last.ticks}")
        return "  |  ".join(parts)
