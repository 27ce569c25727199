"""An empty figure, and what the figures of all papers have in common."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from agents.figures.canvas import new_canvas
from agents.figures.curve_labels import label_curves
from hybrid_env.rendering.evidence import mode_colour

DPI = 110
GREY = "#9a9a9a"
DARK_GREY = "#4d4d4d"
TRUTH = "#1a1a1a"
RUN = 0
"""Index of the run that is drawn."""


def new_figure(title: str, size: tuple[float, float], widths: Sequence[float]) -> tuple[Figure, Any]:
    """Return a figure with axes in a row.

    Args:
        title: above all axes.
        size: width and height [inch].
        widths: relative width of each of the axes.
    """
    figure = new_canvas(size, DPI)
    figure.suptitle(title)
    return figure, figure.subplots(1, len(widths), width_ratios=widths)


def style_map(axes: Any, title: str, unit: str = "m") -> None:
    """Make axes a map with its title."""
    axes.set(title=title, xlabel=f"x [{unit}]", ylabel=f"y [{unit}]")
    axes.set_aspect("equal", adjustable="datalim")
    axes.grid(alpha=0.25)


def plot_by_mode(
    axes: Any, positions: NDArray[np.float64], modes: NDArray[np.int64], radii: Sequence[float], **style: Any
) -> list[Line2D]:
    """Draw positions, (T, 2), with one line per interval of constant mode, in the colour of the mode."""
    borders = [0, *(np.flatnonzero(np.diff(modes)) + 1).tolist(), len(modes)]
    return [
        axes.plot(
            *positions[max(first - 1, 0) : last].T, color=mode_colour(int(modes[first]), radii), **style
        )[0]
        for first, last in pairwise(borders)
    ]


def label_lines(axes: Any) -> None:
    """Write the label of each line that has one beside it; call this last, see `label_curves`."""
    labels = [(line, line.get_label()) for line in axes.lines]
    label_curves(axes, [(line, text) for line, text in labels if not text.startswith("_")])


def decimal(value: float) -> str:
    """One decimal, with the minus sign of the axes."""
    return f"{value:.1f}".replace("-", "\N{MINUS SIGN}")
