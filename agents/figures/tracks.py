"""A track in the plane by its modes, and modes over time as bars: the true ones and those of
deciders.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import ArrayLike

from agents.figures.canvas import DARK_GREY, GREY, legend_beside, new_canvas, plain_axes
from agents.figures.decider_colours import decider_styles
from hybrid_env.checks import BoolArray, FloatArray, IntArray
from hybrid_env.rendering.evidence import mode_colour, mode_name

# In place of a mode at ticks before a declaration.
UNDECIDED = -1
UNDECIDED_COLOUR = "0.92"


def runs(values: IntArray, breaks: ArrayLike = ()) -> list[tuple[int, int, int]]:
    """Return (first index, index after the last, value) of each run of equal values between two
    breaks.
    """
    begins = np.union1d(np.flatnonzero(np.diff(values, prepend=values[0] - 1)), breaks).astype(
        np.int64
    )
    return list(
        zip(
            begins.tolist(),
            [*begins[1:].tolist(), len(values)],
            values[begins].tolist(),
            strict=True,
        )
    )


def draw_by_mode(
    axes: Any,
    points: FloatArray,
    modes: IntArray,
    colours: Sequence[str],
    **style: Any,
) -> None:
    """Draw a line through the points (T, 2) in the colour of the mode of each point."""
    lines = []
    shades = []
    for begin, stop, mode in runs(modes):
        lines.append(points[max(begin - 1, 0) : stop])
        shades.append(colours[mode])
    axes.add_collection(LineCollection(lines, colors=shades, capstyle="butt", **style))
    axes.autoscale_view()


@dataclass(frozen=True, kw_only=True)
class TrackRecord:
    """What a decider declared or stated on a track of T ticks."""

    # Of the decider.
    name: str
    # (T, 2) positions [m]
    truth: FloatArray
    # Likewise.
    measurements: FloatArray
    # (T,) true mode of each tick.
    true_modes: IntArray
    # (T,) declared or stated mode of each tick, `UNDECIDED` before a declaration.
    modes: IntArray
    # (T,) whether the decision of the tick, or of its segment, is right.
    right: BoolArray
    # (n,) 0-based ticks at which a mode is declared, or the statement changes.
    marks: IntArray
    # (K,) 0-based first tick of each segment if the switches are announced, else empty.
    switches: IntArray
    # (T, 2) estimated positions [m]
    estimates: FloatArray
    # Figures of the decider on this track.
    summary: str


def track_figure(records: Sequence[TrackRecord], radii: Sequence[float], title: str) -> Figure:
    """The track by its modes, estimates and decisions of one or two deciders, and their modes
    over time; radii in m.
    """
    canvas = new_canvas((12, 8))
    track, timeline = canvas.subplots(2, 1, height_ratios=(3, 0.5 + 0.3 * len(records)))
    first = records[0]
    modes = range(2 * len(radii) + 1)
    rows = {"true mode": first.true_modes} | {record.name: record.modes for record in records}
    wrong = {record.name: ~record.right & (record.modes != UNDECIDED) for record in records}
    colours, names = ([of(mode, radii) for mode in modes] for of in (mode_colour, mode_name))
    draw_timelines(
        timeline,
        np.arange(len(first.truth) + 1),
        rows,
        colours,
        "tick of the episode",
        wrong=wrong,
        breaks=first.switches,
        names=names,
        edge_width=0.5,
    )
    undecided = [Patch(color=UNDECIDED_COLOUR, label="before the decision (ticks)")] * (
        len(first.switches) > 0
    )
    legend_beside(timeline, handles=[*undecided, wrong_patch("wrong mode")])
    draw_by_mode(track, first.truth, first.true_modes, colours, linewidths=5, alpha=0.4, zorder=1)
    handles = track.plot(
        *first.measurements[::4].T,
        ".",
        color=GREY,
        markersize=2.5,
        label="every fourth measurement",
    )
    if undecided:
        switches = first.truth[first.switches].T
        handles += track.plot(
            *switches,
            "|",
            color=DARK_GREY,
            markersize=12,
            zorder=4,
            label="mode switch",
        )
    styles = decider_styles(record.name for record in records)
    # Changes of the first and of the second decider may coincide.
    for record, size in zip(records, (12.0, 7.0), strict=False):
        style = styles[record.name]
        label = f"{record.name}: estimate"
        handles += track.plot(
            *record.estimates.T,
            color=style.colour,
            linewidth=1.2,
            zorder=3,
            label=label,
        )
        for right, face in (
            (True, style.colour),
            (False, "white"),
        ):
            ticks = record.marks[record.right[record.marks] == right]
            handles += track.plot(
                *record.truth[ticks].T,
                linestyle="none",
                marker=style.marker,
                markersize=size,
                zorder=5,
                color=style.colour,
                markerfacecolor=face,
                markeredgewidth=1.6,
                label=f"{record.name}: {'right' if right else 'wrong'} decision",
            )
    plain_axes(track, "x, m", "y, m")
    track.set_aspect("equal", adjustable="datalim")
    legend_beside(track, handles=handles)
    canvas.suptitle(title)
    return canvas


def draw_timelines(
    axes: Any,
    edges: ArrayLike,
    rows: Mapping[str, IntArray],
    colours: Sequence[str],
    xlabel: str,
    *,
    wrong: Mapping[str, BoolArray],
    breaks: ArrayLike = (),
    names: Sequence[str] = (),
    edge_width: float = 0.0,
) -> None:
    """Draw the modes (T,) of each row as bars between `edges` (T + 1,): indices of `colours` or
    others above.

    Bars begin anew at ticks `breaks`, and are hatched at ticks `wrong` (T,). `names` of the modes
    are written into bars that are long enough, as is the length of undecided ones. edge_width: of
    the white edges [pt].
    """
    limits = np.asarray(edges)
    axes.set_xlim(0, limits[-1])
    for height, (row, modes) in enumerate(rows.items()):
        hatched = wrong.get(row, np.zeros(len(modes), np.bool_))
        for first, end, key in runs(2 * modes + hatched, breaks):
            mode = key // 2
            span = (limits[first], limits[end])
            colour = UNDECIDED_COLOUR if mode == UNDECIDED else colours[mode]
            axes.barh(
                height,
                span[1] - span[0],
                left=span[0],
                color=colour,
                edgecolor="white",
                linewidth=edge_width,
                hatch="xxx" if key % 2 else None,
            )
            if names:
                text = str(end - first) if mode == UNDECIDED else names[mode]
                _write_into(axes, height, span, text, colour, always=mode == UNDECIDED)
    axes.set_yticks(range(len(rows)), list(rows))
    axes.invert_yaxis()
    axes.set_xlabel(xlabel)
    axes.spines[["top", "right", "left"]].set_visible(False)


def _write_into(
    axes: Any,
    height: int,
    span: tuple[float, float],
    text: str,
    colour: str,
    always: bool,
) -> None:
    """Write a text into a bar, if it is long enough or the text is always shown."""
    style: dict[str, Any] = {
        "va": "center",
        "ha": "center",
        "fontsize": 8.5,
    }
    if not always:
        style["color"] = "white" if np.mean(to_rgb(colour)) < 0.55 else "black"
        style["bbox"] = {
            "facecolor": colour,
            "edgecolor": "none",
            "pad": 1.5,
        }
    # A character takes so much of the time axis.
    if always or (span[1] - span[0]) / axes.get_xlim()[1] > 0.009 * len(text):
        axes.text(sum(span) / 2, height, text, **style)


def wrong_patch(label: str) -> Patch:
    """Return the entry of the legend for hatched bars."""
    return Patch(
        facecolor="0.6",
        edgecolor="white",
        hatch="xxx",
        label=label,
    )
