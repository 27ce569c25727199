"""An empty figure, and the style of its axes."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

GREY = "#9a9a9a"
"""Of measurements."""

WIDTH = 5.2
"""Of a figure [in]: with text of 10 pt it can be read on a narrow screen."""


def new_canvas(height: float, width: float = WIDTH) -> "Figure":
    """Return an empty figure of a height and a width [in]."""
    # Commands that draw nothing start faster without it.
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    canvas = Figure(figsize=(width, height), layout="constrained", dpi=110)
    FigureCanvasAgg(canvas)
    return canvas


def plain_axes(axes: Any, xlabel: str = "", ylabel: str = "") -> None:
    """Give axes a pale grid, no frame at the top and on the right, and labels."""
    axes.grid(alpha=0.25)
    axes.spines[["top", "right"]].set_visible(False)
    axes.set(xlabel=xlabel, ylabel=ylabel)


def legend_beside(axes: Any, **handles: Any) -> None:
    """Add a legend without a frame, on the right of axes."""
    axes.legend(frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5), **handles)
