"""Parts of the figures of several papers."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray

# Of measurements, of lines beside curves, and of the true track.
GREY, DARK_GREY, TRUTH = "#9a9a9a", "#4d4d4d", "#1a1a1a"
# Straight, left and right.
TYPE_COLOURS = ("#d55e00", "#0072b2", "#009e73")
TYPE_NAMES = ("straight", "left turn", "right turn")


def new_figure(
    title: str,
    size: tuple[float, float],
    widths: Sequence[float],
    rows: int = 1,
) -> tuple[Figure, Any]:
    """Return a figure of width and height [in], with rows of axes of relative widths."""
    figure = Figure(figsize=size, layout="constrained", dpi=110)
    figure.suptitle(title)
    axes = figure.subplots(rows, len(widths), width_ratios=widths)
    for part in axes.flat:
        part.grid(alpha=0.25)
    return figure, axes


def style_map(
    axes: Any,
    title: str,
    unit: str = "m",
) -> None:
    """Make axes a map with its title."""
    axes.set(title=title, xlabel=f"x [{unit}]", ylabel=f"y [{unit}]")
    axes.set_aspect("equal", adjustable="datalim")


def draw_by_type(
    axes: Any,
    points: NDArray[np.float64],
    types: NDArray[np.int64],
    **style: Any,
) -> None:
    """Draw a line through points (T, 2) in the colours of their types (T,): 0 straight, 1 left,
    2 right.
    """
    pieces = np.stack([points[:-1], points[1:]], axis=1)
    colours = np.array(TYPE_COLOURS)[types[1:]]
    axes.add_collection(LineCollection(list(pieces), colors=colours, **style))
    axes.autoscale_view()


def draw_thresholds(
    axes: Any,
    upper: float,
    lower: float,
) -> None:
    """Draw ln A and ln B, with their values."""
    for name, value in (("ln A", upper), ("ln B", lower)):
        axes.axhline(
            value,
            color=DARK_GREY,
            linestyle="--",
            linewidth=0.9,
            zorder=1,
        )
        axes.annotate(
            f"{name}\n{value:.1f}",
            (1.0, value),
            xycoords=("axes fraction", "data"),
            xytext=(4, 0),
            textcoords="offset points",
            va="center",
        )


def draw_tracking(
    title: str,
    recording: Any,
    tracks: Any,
    types: NDArray[np.int64],
    thresholds: tuple[float, float],
) -> Figure:
    """Return the first run of ATE: the estimate over the true trajectory, and the log-likelihood
    ratios of all hypotheses, whose types are (M,), to the active mode until each decision.
    """
    figure, (ground, ratios) = new_figure(
        title,
        (13.0, 6.4),
        (1.0, 1.15),
    )
    style_map(ground, "Trajectory; labels: true mode of each segment")
    ends = np.cumsum(recording.lengths)
    truth = recording.truth[0][:, [0, 2]]
    ground.plot(
        *recording.measurements[0].T,
        ".",
        color=GREY,
        markersize=2.5,
        label="measurements",
    )
    ground.plot(
        *truth.T,
        color=TRUTH,
        linewidth=3.4,
        label="true trajectory",
    )
    for number, radius in enumerate(recording.signed_radii):
        middle = truth[ends[number] - recording.lengths[number] // 2]
        turn = f"{'left' if radius > 0.0 else 'right'} turn, r = {abs(radius):g} m"
        text = f"{number + 1}: {turn if radius else 'straight'}"
        ground.annotate(
            text,
            middle,
            (8, 8),
            textcoords="offset points",
            fontsize=9,
            zorder=5,
        )
    estimate = tracks.estimates[0][:, [0, 2]]
    draw_by_type(
        ground,
        estimate,
        types[tracks.modes[0]],
        linewidths=1.5,
        zorder=3,
    )
    decided = (ends - recording.lengths + tracks.ticks[0])[~tracks.undecided[0]] - 1
    ring = {"markerfacecolor": "white", "markeredgecolor": "black"}
    ground.plot(
        *estimate[decided].T,
        "o",
        markersize=5,
        zorder=4,
        label="decision",
        **ring,
    )
    ground.plot(
        *truth[0],
        "s",
        color="black",
        markersize=6,
        zorder=4,
        label="start",
    )

    ticks = np.arange(1, len(tracks.ratios[0]) + 1)
    for values, kind in zip(tracks.ratios[0].T, types, strict=True):
        ratios.plot(
            ticks,
            values,
            color=TYPE_COLOURS[kind],
            linewidth=0.9,
        )
    for kind, name in enumerate(TYPE_NAMES):
        ratios.plot(
            [],
            [],
            color=TYPE_COLOURS[kind],
            label=name,
        )
    upper, lower = thresholds
    draw_thresholds(ratios, upper, lower)
    for end in ends[:-1]:
        ratios.axvline(
            end + 0.5,
            color="0.75",
            linewidth=0.8,
            zorder=0,
        )
    ratios.set(
        title="Sequential tests, each until its decision",
        xlabel="tick",
        ylabel="log-likelihood ratio to the active mode",
        xlim=(0, len(ticks)),
        ylim=(2.0 * lower, 2.0 * upper),
    )
    figure.legend(loc="outside lower center", ncols=8, frameon=False)
    return figure
