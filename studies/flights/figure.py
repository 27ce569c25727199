"""The picture of a recorded flight: its ground track and timelines by the modes."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from studies.flights.flight import Flight
from studies.flights.labels import MODE_NAMES
from studies.flights.turns import FloatArray, IntArray

# Straight, left, right: red, blue and green in the palette of Okabe and Ito.
COLOURS = ("#d55e00", "#0072b2", "#009e73")
UNSCORED = "#c8c8c8"
# In place of a mode in a gap.
GAP = -1
# Of the labels and of the statements [pt].
WIDE, NARROW = 6.0, 1.6


def runs(values: IntArray) -> Iterator[tuple[int, int, int]]:
    """Yield first index, index after the last, and value of each run of equal values."""
    begins = np.flatnonzero(np.diff(values, prepend=values[0] - 1)).tolist()
    ends = [*begins[1:], len(values)]
    yield from zip(begins, ends, values[begins].tolist(), strict=True)


def draw_by_mode(
    axes: Any,
    points: FloatArray,
    modes: IntArray,
    pieces: Sequence[tuple[int, int]],
    colours: Sequence[Any],
    width: float,
) -> None:
    """Draw a line through the points (n, 2) of each piece in the colours of the modes (n,)."""
    lines = []
    shades = []
    for first, end in pieces:
        for begin, stop, mode in runs(modes[first:end]):
            lines.append(points[max(first + begin - 1, first) : first + stop])
            shades.append(colours[mode])
    axes.add_collection(LineCollection(lines, colors=shades, linewidths=width, capstyle="butt"))


def flight_figure(
    flight: Flight,
    labels: IntArray,
    stated: Mapping[str, IntArray],
    title: str,
    label: str = "label",
) -> Figure:
    """Draw the ground track by the modes of the first decider over the labels, and all modes over
    time.

    Args:
        flight: of n positions.
        labels: (n,) modes, or 3 where they are not scored.
        stated: statements (n,) by the name of the decider.
        title: of the picture.
        label: what the labels are called.
    """
    points, minutes, pieces = flight.positions / 1000.0, flight.times / 60.0, flight.pieces
    width, height = np.maximum(
        np.ptp(flight.positions, axis=0),
        1.0,
    )
    tall = float(np.clip(9.0 * height / width, 3.5, 8.0))
    bars = 0.8 + 0.3 * (1 + len(stated))
    figure = Figure(
        figsize=(10.0, tall + bars + 1.2),
        layout="constrained",
        dpi=110,
    )
    ground, timeline = figure.subplots(2, 1, height_ratios=(tall, bars))
    name, modes = next(iter(stated.items()))
    pale = [tuple(0.4 * np.array(to_rgb(colour)) + 0.6) for colour in COLOURS] + [UNSCORED]
    draw_by_mode(ground, points, labels, pieces, pale, WIDE)
    draw_by_mode(ground, points, modes, pieces, COLOURS, NARROW)
    ground.plot(
        *points[0],
        "s",
        color="black",
        markersize=5,
    )
    ground.set_aspect("equal", adjustable="datalim")
    ground.grid(alpha=0.25)
    ground.set(xlabel="x east [km]", ylabel="y north [km]")
    inside = np.zeros(len(minutes), np.bool_)
    for first, end in pieces:
        # The last position ends the last bar.
        inside[first : end - 1] = True
    edges = np.append(minutes, minutes[-1])
    rows = {label: labels, **stated}
    for row, values in enumerate(rows.values()):
        for first, end, mode in runs(np.where(inside, values, GAP)):
            if mode != GAP:
                length = edges[end] - edges[first]
                colour = (*COLOURS, UNSCORED)[mode]
                timeline.barh(
                    row,
                    length,
                    left=edges[first],
                    color=colour,
                )
    timeline.set(xlabel="t [min]", xlim=(0.0, edges[-1]))
    timeline.set_yticks(range(len(rows)), list(rows))
    timeline.invert_yaxis()
    timeline.spines[["top", "right", "left"]].set_visible(False)
    handles = [
        Line2D([], [], color=colour, linewidth=2.5, label=mode)
        for colour, mode in zip(COLOURS, MODE_NAMES, strict=True)
    ]
    handles.append(Line2D([], [], color=pale[1], linewidth=WIDE, label=f"pale: {label}"))
    if (labels == len(MODE_NAMES)).any():
        handles.append(Line2D([], [], color=UNSCORED, linewidth=WIDE, label="not scored"))
    figure.legend(
        handles=handles,
        loc="outside right upper",
        frameon=False,
        title=f"line: {name}",
    )
    figure.suptitle(title)
    return figure
