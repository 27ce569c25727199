"""Figures of the papers on ATE: one run for each measurement variance, and its sequential tests."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from agents.figures.canvas import GREY, TRUTH, paper_figure, style_map
from agents.figures.tracks import draw_by_mode
from baselines.rules.sprt import sprt_thresholds
from hybrid_env.rendering.evidence import TYPE_COLOURS, mode_colour
from studies.papers.golubkov2018 import ALPHA, MEASUREMENT_VARIANCES, RADII
from studies.papers.reproduction import Reproduction

TYPE_NAMES = ("straight", "left turn", "right turn")
# Index of the run that is drawn.
RUN = 0


def draw(result: Reproduction) -> dict[str, Figure]:
    """Return the figures by their file names."""
    return tracking_figures("golubkov2018", result, MEASUREMENT_VARIANCES, RADII, ALPHA)


def tracking_figures(
    paper: str,
    result: Reproduction,
    variances: dict[str, float],
    radii: Sequence[float],
    alpha: float,
) -> dict[str, Figure]:
    """Return a figure by its file name for each measurement variance R [m^2]; radii of the
    hypotheses in m.
    """
    figures = {}
    for index, (name, (recording, tracks)) in enumerate(result.examples.items(), start=1):
        title = f"{result.paper}: one run of ATE, measurement variance R = {variances[name]:g} m²"
        figures[f"{paper}_{index}.png"] = _tracking_figure(title, recording, tracks, radii, alpha)
    return figures


def _tracking_figure(
    title: str,
    recording: Any,
    tracks: Any,
    radii: Sequence[float],
    alpha: float,
) -> Figure:
    """Estimate over the true trajectory, and log-likelihood ratios with their thresholds."""
    figure, (map_axes, ratio_axes) = paper_figure(title, (13.0, 6.4), (1.0, 1.15))
    ends = np.cumsum(recording.lengths)
    style_map(map_axes, "Trajectory; labels: true mode of each segment")
    map_axes.plot(
        *recording.measurements[RUN].T,
        ".",
        color=GREY,
        markersize=2.5,
        alpha=0.6,
        zorder=1,
    )
    truth = recording.truth[RUN][:, [0, 2]]
    map_axes.plot(*truth.T, color=TRUTH, linewidth=3.4, zorder=2)
    segments = zip(ends, recording.lengths, recording.signed_radii, strict=True)
    for number, (end, length, radius) in enumerate(segments, start=1):
        turn = f"{'left' if radius > 0.0 else 'right'} turn, r = {abs(radius):g} m"
        text = f"{number}: {turn if radius else 'straight'}"
        map_axes.annotate(
            text,
            truth[end - length // 2],
            (8, 8),
            textcoords="offset points",
            fontsize=9,
            zorder=5,
            bbox={
                "facecolor": "white",
                "edgecolor": "none",
                "alpha": 0.8,
                "pad": 1.0,
            },
        )
    estimate = tracks.estimates[RUN][:, [0, 2]]
    colours = [mode_colour(mode, radii) for mode in range(2 * len(radii) + 1)]
    draw_by_mode(map_axes, estimate, tracks.modes[RUN], colours, linewidths=1.5, zorder=3)
    decided = (ends - recording.lengths + tracks.ticks[RUN])[~tracks.undecided[RUN]] - 1
    map_axes.plot(
        *estimate[decided].T,
        "o",
        markersize=5,
        markerfacecolor="white",
        markeredgecolor="black",
        zorder=4,
    )
    map_axes.plot(*truth[0], "s", color="black", markersize=6, zorder=4)

    _draw_ratios(ratio_axes, recording, tracks, colours, alpha)
    ring: dict[str, Any] = {
        "marker": "o",
        "markerfacecolor": "white",
        "markeredgecolor": "black",
        "linestyle": "none",
    }
    types = zip(TYPE_COLOURS, TYPE_NAMES, strict=True)
    handles = [
        Line2D(
            [],
            [],
            color="black",
            marker="s",
            linestyle="none",
            markersize=6,
            label="start",
        ),
        Line2D(
            [],
            [],
            color=GREY,
            marker=".",
            linestyle="none",
            label="measurements",
        ),
        Line2D([], [], color=TRUTH, linewidth=3.4, label="true trajectory"),
        *(Line2D([], [], color=colour, linewidth=2, label=name) for colour, name in types),
        Line2D([], [], **ring, markersize=5, label="decision"),
    ]
    shades = "; darker shades: smaller radii" if len(radii) > 1 else ""
    figure.legend(
        handles=handles,
        loc="outside lower center",
        ncols=len(handles),
        frameon=False,
        title=f"Colours: active mode of the estimate (left) and hypothesis (right){shades}",
    )
    return figure


def _draw_ratios(
    axes: Any,
    recording: Any,
    tracks: Any,
    colours: Sequence[str],
    alpha: float,
) -> None:
    """Log-likelihood ratio of every hypothesis to the active mode, up to the decision of each
    segment.
    """
    ratios = tracks.ratios[RUN]
    ticks = np.arange(1, len(ratios) + 1)
    for mode, colour in enumerate(colours):
        axes.plot(ticks, ratios[:, mode], color=colour, linewidth=0.9)
    upper, lower = sprt_thresholds(alpha)
    for name, threshold in (
        ("ln A", upper),
        ("ln B", lower),
    ):
        axes.axhline(
            threshold,
            color="0.3",
            linestyle="--",
            linewidth=0.9,
            zorder=1,
        )
        axes.annotate(
            f"{name}\n{decimal(threshold)}",
            (1.0, threshold),
            xycoords=("axes fraction", "data"),
            xytext=(4, 0),
            textcoords="offset points",
            va="center",
        )
    ends = np.cumsum(recording.lengths)
    for end in ends[:-1]:
        axes.axvline(end + 0.5, color="0.75", linewidth=0.8, zorder=0)
    numbers = axes.secondary_xaxis("top")
    numbers.set_xticks(
        ends - recording.lengths / 2,
        [str(number) for number in range(1, len(ends) + 1)],
    )
    # Inside the axes.
    numbers.tick_params(length=0, pad=-16)
    axes.set(
        title=f"Sequential tests of segments 1 to {len(ends)}, each until its decision",
        xlabel="tick",
        ylabel="log-likelihood ratio to the active mode",
        xlim=(0, len(ratios)),
        ylim=(2.0 * lower, 2.0 * upper),
    )


def decimal(value: float) -> str:
    """One decimal, with the minus sign of the axes."""
    return f"{value:.1f}".replace("-", "\N{MINUS SIGN}")
