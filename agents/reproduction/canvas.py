"""An empty figure, and what the figures of all papers have in common."""

from collections.abc import Sequence
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

DPI = 110
GREY = "#9a9a9a"


def new_figure(title: str, size: tuple[float, float], widths: Sequence[float]) -> tuple[Figure, Any]:
    """Return a figure with axes in a row.

    Args:
        title: above all axes.
        size: width and height [inch].
        widths: relative width of each of the axes.
    """
    figure = Figure(figsize=size, dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(title)
    return figure, figure.subplots(1, len(widths), width_ratios=widths)
