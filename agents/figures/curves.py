"""Panels of curves, one below the other; every curve is named at its end."""

import re
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter
from numpy.typing import ArrayLike

from agents.figures.canvas import new_canvas, plain_axes
from baselines.scoring.estimates import Estimate
from hybrid_env.checks import FloatArray


@dataclass(frozen=True)
class Curve:
    """One curve."""

    # At its end.
    name: str
    # Colour and marker, see `decider_styles`.
    style: tuple[str, str]
    # x, y: (K,) points; estimates have bars.
    x: ArrayLike
    y: ArrayLike | Sequence[Estimate]
    # (2, K) lower and upper bound of y, drawn as a band.
    bounds: FloatArray | None = None
    # (n, 2) points with large filled markers.
    selected: ArrayLike = ()
    # Size of the markers [pt], 0 for none.
    size: float = 4.5
    # Style of the line.
    dashes: str = "-"


def panel_figure(
    count: int, height: float, title: str = "", note: str = ""
) -> tuple[Figure, list[Any]]:
    """Return a figure, height in inches, and the axes of its panels with one axis of x, below each
    other; `title` and `note` stand above and below all panels.
    """
    canvas = new_canvas(height)
    grid = canvas.subplots(count, squeeze=False, sharex=True)
    canvas.suptitle(textwrap.fill(title, 60), fontsize=11)
    canvas.supxlabel(textwrap.fill(note, 66), fontsize=10, color="0.3")
    return canvas, [*grid.flat]


def draw_panel(axes: Any, curves: Sequence[Curve], note: str = "", **settings: Any) -> None:
    """Draw curves, in their order, with their names at their ends, and a note at the upper end;
    `settings` are those of `axes.set`, in this order.
    """
    for curve in curves:
        _draw_curve(axes, curve)
    plain_axes(axes)
    axes.set(**settings)
    axes.title.set_fontsize(10)
    for name in "xy":
        # Their labels are given.
        if f"{name}ticks" in settings:
            getattr(axes, f"{name}axis").set_minor_formatter(NullFormatter())
    axes.text(0.01, 0.98, note, transform=axes.transAxes, va="top", color="0.3")
    axes.label_outer()
    _label_curves(axes)


def draw_levels(axes: Any, levels: Mapping[float, str]) -> None:
    """Mark values of y by dashed lines with their names."""
    for level, words in levels.items():
        axes.axhline(level, color="0.6", linewidth=0.8, linestyle="--", zorder=0)
        # The highest above its line, others below theirs.
        above = level == max(levels)
        axes.annotate(
            words,
            (0.99, level),
            (0, 2 if above else -2),
            xycoords=axes.get_yaxis_transform(),
            textcoords="offset points",
            ha="right",
            va="bottom" if above else "top",
            color="0.3",
        )


def _label_curves(axes: Any) -> None:
    """Write the names of curves on the right of the axes, each with a line to the last point that
    is seen, and so far apart that they can be read.
    """
    to_axes = axes.transScale + axes.transLimits
    ends = []
    for line, name in zip(*axes.get_legend_handles_labels(), strict=True):
        points = to_axes.transform(line.get_xydata())
        seen = points[((points >= 0.0) & (points <= 1.0)).all(axis=1)]
        if len(seen):
            ends.append((*seen[-1], line.get_color(), name))
    ends.sort(key=lambda end: end[1])
    height = 0.0
    for after, (x, y, colour, name) in zip(range(len(ends))[::-1], ends, strict=True):
        # Room for the labels that follow.
        height = min(max(y, height), 1.0 - 0.08 * after)
        axes.annotate(
            # The bank, if it is named, in a line of its own.
            re.sub(r", (?=\S+ bank$)", ",\n", name),
            (x, y),
            (1.03, height),
            xycoords="axes fraction",
            textcoords="axes fraction",
            va="center",
            color=colour,
            arrowprops={"arrowstyle": "-", "color": colour, "linewidth": 0.7},
        )
        height += 0.08


def _draw_curve(axes: Any, curve: Curve) -> None:
    colour, marker = curve.style
    if curve.bounds is not None:
        axes.fill_between(curve.x, *curve.bounds, color=colour, alpha=0.13, linewidth=0)
    y: Any = curve.y
    values = [point.value if isinstance(point, Estimate) else point for point in y]
    if any(isinstance(point, Estimate) for point in y):
        # Down and up to the bounds.
        bars = np.array([[point.value - point.low, point.high - point.value] for point in y])
        axes.errorbar(curve.x, values, bars.T, color=colour, linestyle="none", linewidth=1)
    axes.plot(
        curve.x,
        values,
        color=colour,
        marker=marker if curve.size else None,
        markersize=curve.size,
        markerfacecolor="white",
        linewidth=1.4,
        linestyle=curve.dashes,
        label=curve.name.replace("$", r"\$"),
    )
    selected = np.reshape(curve.selected, (-1, 2)).T
    axes.plot(*selected, linestyle="none", color=colour, marker=marker, markersize=8, zorder=5)
