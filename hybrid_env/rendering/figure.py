"""Frames of an episode: the track in the plane, below it heights if there are any, and the evidence
over time. Each frame sets new data on the artists that change; all others are in a background
image. A decision has the same marker in both panels: a circle if correct, a cross if wrong.
"""

from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from hybrid_env.checks import FloatArray
from hybrid_env.rendering import FRAME_SIZE
from hybrid_env.rendering.evidence import EvidencePanel, legend_colours, mode_colour, mode_name
from hybrid_env.rendering.history import History


class EpisodeFigure:
    """The matplotlib figure, `FRAME_SIZE` pixels large, with both panels and the legends."""

    def __init__(self, options: Any, panel: EvidencePanel):
        self.options = options
        self.panel = panel
        colours = [mode_colour(mode, options.all_modes) for mode in range(options.hypotheses)]
        # (M + 1, 3): that of the last one is no mode.
        self._colours = np.array([to_rgb(colour) for colour in (*colours, "white")])
        width, height = FRAME_SIZE
        self.figure = Figure(figsize=(width / 100, height / 100), dpi=100)
        self._canvas = FigureCanvasAgg(self.figure)
        # The plane shown: its episode, centre and half height [m].
        self._episode = -1
        self._centre = np.zeros(2)
        self._half = 0.0
        # Changed with every frame; the first one is drawn first.
        self._changing: list[Any] = []
        # Bottom and height of the panels: the plane, the heights and the evidence.
        places = [(0.71, 0.23), (0.505, 0.12), (0.25, 0.15)]
        if not options.climbs:
            places = [(0.58, 0.36), (0.23, 0.24)]
        self._track = self._add_axes(*places[0], "x [m]", "y [m]")
        self._truth = self._line(self._track, "true path", color="#b4b4b4", linewidth=4)
        self._measured = self._points(self._track, "measurement", ".", 2.5, "#8a8a8a")
        self._estimate = LineCollection([], linewidths=1.6)
        self._track.add_collection(self._estimate, autolim=False)
        self._changing.append(self._estimate)
        self._switches = self._points(self._track, "switch", "D", 5)
        self._strip: Any = None
        if options.climbs:
            self._strip = self._add_axes(*places[1], "time [ticks]", "z [m]")
            self._strip.plot([], [], "C7-", [], [], "k.", [], [], "k-", lw=1.6, ms=2.5)
            # With its limits.
            self._changing.append(self._strip)
        self._evidence = self._add_axes(*places[-1], "time [ticks]")
        self._evidence.set_title(panel.label, fontsize=9)
        self._add_panel()
        # Marks on each axes, by whether the decision is correct.
        self._decisions = [
            {
                True: self._points(axes, "correct decision", "o", 6),
                False: self._points(axes, "wrong decision", "X", 6),
            }
            for axes in (self._track, self._evidence)
        ]
        self._current = self._points(self._track, "current position", "*", 12, "#f0e442")
        self._title = self.figure.text(0.5, 0.97, "", ha="center", va="center", fontsize=10)
        self._changing.append(self._title)
        for artist in self._changing:
            # Excluded from the background.
            artist.set_animated(True)
        self._add_legends()

    def _add_axes(self, bottom: float, height: float, xlabel: str, ylabel: str = "") -> Any:
        axes = self.figure.add_axes((0.15, bottom, 0.81, height))
        axes.tick_params(labelsize=9)
        axes.set_xlabel(xlabel, fontsize=9)
        axes.set_ylabel(ylabel, fontsize=9)
        axes.locator_params(axis="x", nbins=6)
        return axes

    def _line(self, axes: Any, name: str = "", **style: Any) -> Line2D:
        """Add a line that frames change."""
        (line,) = axes.plot([], [], label=name, **style)
        self._changing.append(line)
        return line

    def _points(
        self, axes: Any, name: str, marker: str, size: float, colour: str = "white"
    ) -> Line2D:
        """Add points that frames change, with a black edge if they are large."""
        return self._line(
            axes,
            name,
            marker=marker,
            linestyle="none",
            color=colour,
            markersize=size,
            markeredgecolor="black" if size > 4 else colour,
        )

    def _add_panel(self) -> None:
        """Add curves, thresholds and ribbons of the evidence."""
        axes, panel = self._evidence, self.panel
        if panel.scale == "logit":
            axes.set_yscale("logit", nonpositive="clip", one_half="0.5")
            axes.minorticks_off()
            axes.yaxis.set_major_formatter("{x:.7g}")
        for name, level in panel.thresholds.items():
            axes.axhline(level, linestyle="--", color="#555555", linewidth=1)
            axes.text(1.01, level, name, transform=axes.get_yaxis_transform(), va="center")
        self._curves = {
            mode: self._line(axes, color=colour, linewidth=1.3)
            for mode, colour in panel.colours(self.options.all_modes).items()
        }
        if panel.ribbons:
            # Rows of true and of stated modes.
            self._ribbons = axes.imshow(np.ones((2, 1, 3)), aspect="auto", interpolation="none")
            self._changing.append(self._ribbons)
            axes.set_yticks([-0.12, -0.26, 0.0, 0.5, 1.0], ["true", "stated", "0", "0.5", "1"])
        axes.set(xlim=(0, self.options.most_ticks), ylim=panel.limits)

    def _add_legends(self) -> None:
        """Add what is drawn, and below it the colours of the modes, by type if there are too
        many.
        """
        colours = legend_colours(self.options.all_modes)
        handles = [Line2D([], [], color=colour, label=name) for name, colour in colours.items()]
        if self.panel.legend:
            handles.append(Line2D([], [], color="#555555", ls="--", label=self.panel.legend))
        named = [self._truth, self._measured, self._switches, self._current]
        if not self.panel.ribbons:
            named += self._decisions[0].values()
        # Names of pairs of modes are long.
        room, size, spacing = (95, 7.5, 0.6) if self.options.climbs else (80, 9, 1.3)
        for height, artists, letters in (
            (0.17, named, 80),
            (0.085 + 0.03 * self.options.climbs, handles, room),
        ):
            longest = max(len(str(artist.get_label())) for artist in artists)
            self.figure.legend(
                handles=artists,
                # As many in a row as their names leave room for.
                ncols=max(1, min(len(artists), letters // (longest + 7))),
                loc="upper center",
                bbox_to_anchor=(0.5, height),
                frameon=False,
                fontsize=size,
                handlelength=1.6,
                columnspacing=spacing,
            )

    def draw(self, history: History) -> NDArray[np.uint8]:
        """Draw a frame, (height, width, 3), a new array."""
        points = np.concatenate([history.points(kind) for kind in ("", "measured_", "estimate_")])
        outside = np.nanmax(np.abs(points - self._centre)) > self._half
        if outside or history.episode != self._episode:
            self._episode = history.episode
            self._show_plane(points)
        self._canvas.restore_region(self._background)
        self._update(history)
        for artist in self._changing:
            artist.draw(self._canvas.get_renderer())
        return np.array(self._canvas.buffer_rgba())[..., :3]

    def _show_plane(self, points: FloatArray) -> None:
        """Draw the background of a plane that is larger than the track so far: a steady picture."""
        low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
        reach = self.options.speed * self.options.tau * self.options.longest_segment
        self._centre = 0.5 * (low + high)
        self._half = max(0.75 * float((high - low).max()), 0.2 * reach)
        x, y = self._centre
        # Metres per pixel are equal on both axes.
        wide = self._half * self._track.bbox.width / self._track.bbox.height
        self._track.set(xlim=(x - wide, x + wide), ylim=(y - self._half, y + self._half))
        self._canvas.draw()
        self._background: Any = self._canvas.copy_from_bbox(self.figure.bbox)

    def _update(self, history: History) -> None:
        """Show the episode so far."""
        truth, evidence, switches = history.points(), history.evidence, history.switches
        self._truth.set_data(truth.T)
        self._measured.set_data(history.points("measured_").T)
        self._switches.set_data(truth[switches].T)
        self._current.set_data(truth[-1:].T)
        for k, line in enumerate(self._strip.lines if self._strip else ()):
            heights = history.column(("z", "measured_z", "estimate_z")[k])
            line.set_data(np.arange(len(truth)), heights)
            self._strip.relim()
            self._strip.autoscale_view()
        estimate = history.points("estimate_")
        modes = np.nan_to_num(history.column("active_mode"), nan=-1.0).astype(int)
        self._estimate.set_segments(list(np.stack([estimate[:-1], estimate[1:]], axis=1)))
        self._estimate.set_color(self._colours[modes[:-1]])
        drawn = history.drawn
        for mode, curve in self._curves.items():
            curve.set_data(drawn + 1, evidence[drawn, mode])
        if self.panel.ribbons:
            self._ribbons.set_data(self._colours[[history.true_modes, modes]])
            self._ribbons.set_extent((0.5, len(modes) + 0.5, -0.33, -0.05))
        for correct in (True, False):
            chosen = [
                (decision["tick"] - 1, decision["decided_mode"])
                for decision in history.decisions
                if decision["correct"] == correct
            ]
            ticks, declared = np.array(chosen, int).reshape(-1, 2).T
            levels = np.clip(evidence[ticks, declared], *self.panel.limits)
            self._decisions[0][correct].set_data(truth[ticks].T)
            self._decisions[1][correct].set_data(ticks + 1, levels)
        true, stated = (
            mode_name(int(mode), self.options.all_modes) if mode >= 0 else "-"
            for mode in (history.true_modes[-1], modes[-1 if history.finished else -2 :][0])
        )
        word = "stated" if self.panel.ribbons else "decided"
        place = f"segment {history.segment + 1}, tick {history.tick}"
        between = "\n" if self.options.climbs else " "
        self._title.set_text(f"{place}:{between}true {true}, {word} {stated}")
