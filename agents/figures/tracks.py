"""Modes over time as bars: the true ones and those of deciders."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from baselines.scoring.timelines import NO_MODE
from hybrid_env.checks import BoolArray, IntArray

if TYPE_CHECKING:
    from matplotlib.patches import Patch


def draw_timelines(
    axes: Any,
    edges: ArrayLike,
    rows: Mapping[str, IntArray],
    colours: Sequence[str],
    xlabel: str,
    *,
    wrong: Mapping[str, BoolArray],
) -> None:
    """Draw the modes (T,) of each row as bars between `edges` (T + 1,): indices of `colours` or
    `NO_MODE`. Bars are hatched at ticks `wrong` (T,).
    """
    limits = np.asarray(edges)
    axes.set_xlim(0, limits[-1])
    for height, (row, modes) in enumerate(rows.items()):
        hatched = wrong.get(row, np.zeros(len(modes), np.bool_))
        begins = np.append(0, np.flatnonzero(np.diff(2 * modes + hatched)) + 1)
        axes.barh(
            height,
            np.diff(limits[np.append(begins, len(modes))]),
            left=limits[begins],
            color=["0.92" if mode == NO_MODE else colours[mode] for mode in modes[begins]],
            edgecolor="white",
            linewidth=0.5,
            hatch=["xxx" if is_wrong else "" for is_wrong in hatched[begins]],
        )
    axes.set_yticks(range(len(rows)), list(rows))
    axes.invert_yaxis()
    axes.set_xlabel(xlabel)
    axes.spines[["top", "right", "left"]].set_visible(False)


def legend_patches() -> "list[Patch]":
    """Return the entries of the legend for bars of `NO_MODE` and for hatched bars."""
    from matplotlib.patches import Patch

    hatched: dict[str, Any] = {"facecolor": "0.6", "edgecolor": "white", "hatch": "xxx"}
    return [Patch(color="0.92", label="nothing"), Patch(**hatched, label="wrong statement")]
