"""Modes over time as bars, one row for the truth and one for each decider."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.patches import Patch
from numpy.typing import ArrayLike, NDArray

IntArray = NDArray[np.int64]

UNDECIDED = -1
"""In place of a mode at the ticks before a declaration."""
NO_BAR = -2
"""In place of a mode at ticks that are not drawn."""
UNDECIDED_COLOUR = "0.92"
WRONG_HATCH = "xxx"
NAME_LENGTH = 0.009  # of a character, as a share of the time axis


def runs(values: IntArray, breaks: ArrayLike = ()) -> list[tuple[int, int, int]]:
    """Return (first index, index after the last, value) of each run of equal values between two breaks."""
    begins = np.union1d(np.flatnonzero(np.diff(values, prepend=values[0] - 1)), breaks).astype(np.int64)
    return list(
        zip(begins.tolist(), [*begins[1:].tolist(), len(values)], values[begins].tolist(), strict=True)
    )


def draw_timelines(
    axes: Any,
    edges: ArrayLike,
    rows: Mapping[str, IntArray],
    colours: Sequence[str],
    xlabel: str,
    *,
    wrong: Mapping[str, NDArray[np.bool_]] | None = None,
    breaks: ArrayLike = (),
    names: Sequence[str] = (),
    edge_width: float = 1.0,
) -> None:
    """Draw the modes of each row as bars.

    Args:
        axes: to draw in.
        edges: (T + 1,) beginning of each of T ticks, and end of the last one.
        rows: modes (T,) by name, from top to bottom: indices of `colours`, `UNDECIDED` or `NO_BAR`.
        colours: of the modes.
        xlabel: of the axis of time.
        wrong: (T,) ticks that are hatched, by the name of the row.
        breaks: indices of ticks at which every bar begins anew.
        names: of the modes, written into bars that are long enough, as is the length of undecided ones;
            nothing is written without names.
        edge_width: of the white edges of the bars [pt].
    """
    limits = np.asarray(edges)
    axes.set_xlim(0, limits[-1])
    for height, (row, modes) in enumerate(rows.items()):
        hatched = (wrong or {}).get(row, np.zeros(len(modes), np.bool_))
        for first, end, key in runs(2 * modes + hatched, breaks):
            mode, span = key // 2, (limits[first], limits[end])
            if mode == NO_BAR:
                continue
            colour = UNDECIDED_COLOUR if mode == UNDECIDED else colours[mode]
            axes.barh(
                height, span[1] - span[0], left=span[0], color=colour, edgecolor="white",
                linewidth=edge_width, hatch=WRONG_HATCH if key % 2 else None,
            )  # fmt: skip
            if names:
                text = str(end - first) if mode == UNDECIDED else names[mode]
                _write_into(axes, height, span, text, colour, always=mode == UNDECIDED)
    axes.set_yticks(range(len(rows)), list(rows))
    axes.invert_yaxis()
    axes.set_xlabel(xlabel)
    axes.spines[["top", "right", "left"]].set_visible(False)


def _write_into(
    axes: Any, height: int, span: tuple[float, float], text: str, colour: str, always: bool
) -> None:
    """Write a text into a bar, if it is long enough or the text is always shown."""
    middle = sum(span) / 2
    style: dict[str, Any] = {"va": "center", "ha": "center", "fontsize": 8.5}
    if always:
        axes.text(middle, height, text, **style)
    elif (span[1] - span[0]) / axes.get_xlim()[1] > NAME_LENGTH * len(text):
        axes.text(
            middle, height, text, color="white" if np.mean(to_rgb(colour)) < 0.55 else "black",
            bbox={"facecolor": colour, "edgecolor": "none", "pad": 1.5}, **style,
        )  # fmt: skip


def wrong_patch(label: str) -> Patch:
    """Return the entry of the legend for hatched bars."""
    return Patch(facecolor="0.6", edgecolor="white", hatch=WRONG_HATCH, label=label)
