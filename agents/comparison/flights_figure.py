"""Figure of one recorded flight: the ground track by decided mode over the labels, and both over time."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from agents.comparison.figure import DPI
from agents.interface.output_files import atomic_file
from baselines.recordings.flights.flight import Flight
from baselines.recordings.flights.labels import MODE_NAMES, Labels
from hybrid_env.rendering.modes import TYPE_COLOURS, shade

IntArray = NDArray[np.int64]

UNSCORED = "#c8c8c8"
LABEL_WIDTH, DECIDED_WIDTH = 6.0, 1.6


def draw_flight(
    flight: Flight, labels: Labels, stated: Sequence[tuple[str, IntArray]], title: str, path: Path
) -> None:
    """Write `flight_figure` as PNG."""
    canvas = flight_figure(flight, labels, stated, title)
    with atomic_file(path) as part:
        canvas.savefig(part, format="png")


def flight_figure(
    flight: Flight, labels: Labels, stated: Sequence[tuple[str, IntArray]], title: str
) -> Figure:
    """Ground track with the labels as a wide pale line and the modes of the first decider as a thin one.

    Args:
        flight: the flight.
        labels: its labels.
        stated: name and statements (n,) of each decider; the first is drawn on the track.
        title: text above.
    """
    width, height = np.maximum(np.ptp(flight.positions, axis=0), 1.0)
    tall = float(np.clip(9.0 * height / width, 3.5, 8.0))
    bars = 0.8 + 0.3 * (1 + len(stated))
    canvas = Figure(figsize=(10.0, tall + bars + 1.2), dpi=DPI, layout="constrained")
    FigureCanvasAgg(canvas)
    ground, timeline = canvas.subplots(2, 1, height_ratios=(tall, bars))
    _draw_ground(ground, flight, labels, stated[0][1])
    _draw_timeline(timeline, flight, labels, stated)
    canvas.suptitle(title)
    handles = [
        *(
            Line2D([], [], color=TYPE_COLOURS[mode], linewidth=2.5, label=name)
            for mode, name in enumerate(MODE_NAMES)
        ),
        Line2D([], [], color=shade(TYPE_COLOURS[1], 0.6), linewidth=LABEL_WIDTH, label="pale: label"),
        Line2D([], [], color=UNSCORED, linewidth=LABEL_WIDTH, label="not scored"),
    ]
    canvas.legend(handles=handles, loc="outside right upper", frameon=False, title=f"line: {stated[0][0]}")
    return canvas


def _draw_ground(axes: Any, flight: Flight, labels: Labels, stated: IntArray) -> None:
    points = flight.positions / 1000.0
    pale = [shade(colour, 0.6) for colour in TYPE_COLOURS] + [UNSCORED]
    shown = np.where(labels.scored, labels.modes, len(TYPE_COLOURS))
    for modes, colours, width, order in (
        (shown, pale, LABEL_WIDTH, 1), (stated, TYPE_COLOURS, DECIDED_WIDTH, 2),
    ):  # fmt: skip
        lines, shades = [], []
        for first, end in flight.pieces:
            for begin, stop, mode in _runs(modes[first:end]):
                lines.append(points[max(first + begin - 1, first) : first + stop])
                shades.append(colours[mode])
        axes.add_collection(
            LineCollection(lines, colors=shades, linewidths=width, capstyle="butt", zorder=order)
        )
    axes.plot(*points[0], "s", color="black", markersize=5, zorder=3)
    axes.set_aspect("equal", adjustable="datalim")
    axes.autoscale_view()
    axes.grid(alpha=0.25)
    axes.set(xlabel="x east [km]", ylabel="y north [km]")


def _draw_timeline(axes: Any, flight: Flight, labels: Labels, stated: Sequence[tuple[str, IntArray]]) -> None:
    minutes = flight.times / 60.0
    shown = np.where(labels.scored, labels.modes, len(TYPE_COLOURS))
    colours = [*TYPE_COLOURS, UNSCORED]
    for row, modes in enumerate([shown, *(values for _, values in stated)]):
        spans: dict[int, list[tuple[float, float]]] = {}
        for first, end in flight.pieces:
            for begin, stop, mode in _runs(modes[first:end]):
                a, b = minutes[first + begin], minutes[min(first + stop, end - 1)]
                spans.setdefault(mode, []).append((a, b - a))
        for mode, bars in spans.items():
            axes.broken_barh(bars, (row - 0.4, 0.8), facecolors=colours[mode], linewidth=0.0)
    axes.set_yticks(range(1 + len(stated)), ["label", *(name for name, _ in stated)])
    axes.invert_yaxis()
    axes.set_xlim(0.0, minutes[-1])
    axes.set_xlabel("t [min]")
    axes.spines[["top", "right", "left"]].set_visible(False)


def _runs(modes: IntArray) -> list[tuple[int, int, int]]:
    """First row, end and value of each run of equal values."""
    begins = np.flatnonzero(np.diff(modes, prepend=modes[0] - 1))
    ends = np.append(begins, len(modes))[1:]
    return list(zip(begins.tolist(), ends.tolist(), modes[begins].tolist(), strict=True))
