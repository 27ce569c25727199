"""A track in the plane by its modes, and modes over time as bars: the true ones and those of
deciders.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from agents.figures.canvas import DARK_GREY, GREY, legend_beside, new_canvas, plain_axes
from agents.figures.decider_colours import decider_styles
from hybrid_env.checks import BoolArray, IntArray
from hybrid_env.rendering.evidence import Modes, listed, mode_colour, mode_name
from hybrid_env.rendering.history import History

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

# In place of a mode at ticks before a declaration.
UNDECIDED = -1
UNDECIDED_COLOUR = "0.92"


@dataclass(frozen=True, kw_only=True)
class TrackRecord:
    """What a decider declared or stated on a track of T ticks."""

    # Name of the decider.
    name: str
    # History of the episode.
    history: History
    # (T,) declared or stated mode of each tick, `UNDECIDED` before a declaration.
    modes: IntArray
    # (T,) whether the decision of the tick, or of its segment, is right.
    right: BoolArray
    # (n,) 0-based ticks at which a mode is declared, or the statement changes.
    marks: IntArray
    # (K,) 0-based first tick of each segment if the switches are announced, else empty.
    switches: IntArray
    # Figures of the decider on this track.
    summary: str


def track_figure(records: Sequence[TrackRecord], modes: Modes, title: str) -> "Figure":
    """The track by its modes, estimates and decisions of one or two deciders, and their modes
    over time; modes: of the bank, or the radii of their turns [m].
    """
    from matplotlib.collections import LineCollection
    from matplotlib.patches import Patch

    canvas = new_canvas((12, 8))
    track, timeline = canvas.subplots(2, 1, height_ratios=(3, 0.5 + 0.3 * len(records)))
    first = records[0]
    truth = first.history.points()
    true_modes = first.history.true_modes
    colours = [mode_colour(mode, modes) for mode in range(len(listed(modes)))]
    rows = {"true mode": true_modes} | {record.name: record.modes for record in records}
    wrong = {record.name: ~record.right & (record.modes != UNDECIDED) for record in records}
    edges = np.arange(len(truth) + 1)
    draw_timelines(timeline, edges, rows, colours, "tick", wrong=wrong, breaks=first.switches)
    shown = np.unique(np.concatenate(list(rows.values()))).tolist()
    patches = [
        Patch(color=UNDECIDED_COLOUR, label="before the decision")
        if mode == UNDECIDED
        else Patch(color=colours[mode], label=mode_name(mode, modes))
        for mode in shown
    ]
    legend_beside(timeline, handles=[*patches, wrong_patch("wrong mode")])
    steps = np.stack([truth[:-1], truth[1:]], axis=1)
    shades = [colours[mode] for mode in true_modes[1:]]
    track.add_collection(LineCollection(steps.tolist(), colors=shades, linewidths=5, alpha=0.4))
    handles = track.plot(
        *first.history.points("measured_")[::4].T,
        ".",
        color=GREY,
        markersize=2.5,
        label="every fourth measurement",
    )
    if first.switches.size:
        switches = truth[first.switches].T
        handles += track.plot(*switches, "|", color=DARK_GREY, markersize=12, label="mode switch")
    styles = decider_styles(record.name for record in records)
    # Changes of the first and of the second decider may coincide.
    for record, size in zip(records, (12.0, 7.0), strict=False):
        style = styles[record.name]
        label = f"{record.name}: estimate"
        handles += track.plot(
            *record.history.points("estimate_").T, color=style.colour, linewidth=1.2, label=label
        )
        for right, face, word in ((True, style.colour, "right"), (False, "white", "wrong")):
            ticks = record.marks[record.right[record.marks] == right]
            handles += track.plot(
                *truth[ticks].T,
                linestyle="none",
                marker=style.marker,
                markersize=size,
                color=style.colour,
                markerfacecolor=face,
                label=f"{record.name}: {word} decision",
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
) -> None:
    """Draw the modes (T,) of each row as bars between `edges` (T + 1,): indices of `colours` or
    `UNDECIDED`. Bars begin anew at ticks `breaks`, and are hatched at ticks `wrong` (T,).
    """
    limits = np.asarray(edges)
    axes.set_xlim(0, limits[-1])
    for height, (row, modes) in enumerate(rows.items()):
        hatched = wrong.get(row, np.zeros(len(modes), np.bool_))
        changes = np.flatnonzero(np.diff(2 * modes + hatched)) + 1
        begins = np.union1d(np.append(0, changes), breaks).astype(int)
        axes.barh(
            height,
            np.diff(limits[np.append(begins, len(modes))]),
            left=limits[begins],
            color=[
                UNDECIDED_COLOUR if mode == UNDECIDED else colours[mode] for mode in modes[begins]
            ],
            edgecolor="white",
            linewidth=0.5,
            hatch=["xxx" if is_wrong else "" for is_wrong in hatched[begins]],
        )
    axes.set_yticks(range(len(rows)), list(rows))
    axes.invert_yaxis()
    axes.set_xlabel(xlabel)
    axes.spines[["top", "right", "left"]].set_visible(False)


def wrong_patch(label: str) -> "Patch":
    """Return the entry of the legend for hatched bars."""
    from matplotlib.patches import Patch

    return Patch(facecolor="0.6", edgecolor="white", hatch="xxx", label=label)
