"""An empty figure, and the style of its axes."""

from collections.abc import Sequence
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

DPI = 110
GREY, DARK_GREY, TRUTH = "#9a9a9a", "#4d4d4d", "#1a1a1a"
"""Of measurements, of lines beside curves, and of the true track."""


def new_canvas(size: tuple[float, float]) -> Figure:
    """Return an empty figure of width and height [in]."""
    canvas = Figure(figsize=size, layout="constrained", dpi=DPI)
    FigureCanvasAgg(canvas)
    return canvas


def paper_figure(
    title: str,
    size: tuple[float, float],
    widths: Sequence[float],
) -> tuple[Figure, Any]:
    """Return a figure of a paper, of width and height [in], with axes of relative widths in a
    row.
    """
    figure = new_canvas(size)
    figure.suptitle(title)
    return figure, figure.subplots(1, len(widths), width_ratios=widths)


def plain_axes(axes: Any, xlabel: str = "", ylabel: str = "") -> None:
    """Give axes a pale grid, no frame at the top and on the right, and labels."""
    axes.grid(alpha=0.25)
    axes.spines[["top", "right"]].set_visible(False)
    axes.set(xlabel=xlabel, ylabel=ylabel)


def style_map(axes: Any, title: str, unit: str = "m") -> None:
    """Make axes a map with its title."""
    axes.set(title=title, xlabel=f"x [{unit}]", ylabel=f"y [{unit}]")
    axes.set_aspect("equal", adjustable="datalim")
    axes.grid(alpha=0.25)


def legend_beside(axes: Any, **handles: Any) -> None:
    """Add a legend without a frame, on the right of axes."""
    axes.legend(frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5), **handles)
