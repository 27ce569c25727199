"""An empty figure, the style of its axes, and its file."""

from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from agents.interface.output_files import atomic_file

DPI = 120


def new_canvas(size: tuple[float, float], dpi: float = DPI, layout: Any = "constrained") -> Figure:
    """Return an empty figure.

    Args:
        size: width and height [in].
        dpi: dots per inch.
        layout: a layout engine of Matplotlib, or its name.
    """
    canvas = Figure(figsize=size, layout=layout, dpi=dpi)
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


def save_figure(canvas: Figure, path: Path) -> None:
    """Write a figure as PNG, completely or not at all.

    Raises:
        ArgumentError: the file cannot be written.
    """
    with atomic_file(path) as part:
        canvas.savefig(part, format="png")
