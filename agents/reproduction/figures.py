"""Figures of the papers: of the studies that decide here, of others in a file of their own."""

from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from agents.figures.curve_labels import label_curves
from agents.interface.output_files import atomic_file
from agents.reproduction import novospaskyi_figures, zimchuk_figure
from agents.reproduction.canvas import DPI, GREY, new_figure
from baselines.papers import golubkov2018, golubkov2020, tsyganov2019
from baselines.papers.reproduction import Reproduction
from baselines.rules.sprt import sprt_thresholds
from hybrid_env.rendering.modes import TYPE_COLOURS, mode_colour

TYPE_NAMES = ("straight", "left turn", "right turn")
RUN = 0
"""Index of the run that is drawn."""

DARK_GREY = "#4d4d4d"
TRUTH = "#1a1a1a"
ALPHA_COLOURS = ("#000000", "#4477AA", "#CCBB44", "#AA3377")
ALPHA_LINES = ("-", "--", "-.", ":")


def draw_figures(paper: str, result: Reproduction, folder: Path) -> list[str]:
    """Draw the figures of a paper as PNG files.

    Args:
        paper: key of `FIGURES`.
        result: its reproduction.
        folder: existing output folder.

    Returns:
        Names of the files.
    """
    figures = FIGURES[paper](result)
    for name, figure in figures.items():
        with atomic_file(folder / name) as part:
            figure.savefig(part, dpi=DPI)
    return list(figures)


def _tracking_figures(
    paper: str, variances: dict[str, float], radii: Sequence[float], alpha: float, result: Reproduction
) -> dict[str, Figure]:
    """One figure for each variance of a paper that tracks with ATE."""
    return {
        f"{paper}_{index}.png": _tracking_figure(
            f"{result.paper}: one run of ATE, measurement variance R = {variances[name]:g} m²",
            recording, tracks, radii, alpha,
        )
        for index, (name, (recording, tracks)) in enumerate(result.examples.items(), start=1)
    }  # fmt: skip


def _style_map(axes: Any, title: str) -> None:
    axes.set(title=title, xlabel="x [m]", ylabel="y [m]")
    axes.set_aspect("equal", adjustable="datalim")
    axes.grid(alpha=0.25)


def _plot_by_mode(
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


def _mode_label(signed_radius: float) -> str:
    if signed_radius == 0.0:
        return "straight"
    return f"{'left' if signed_radius > 0.0 else 'right'} turn, r = {abs(signed_radius):g} m"


def _tracking_figure(title: str, recording: Any, tracks: Any, radii: Sequence[float], alpha: float) -> Figure:
    """Estimate over the true trajectory, and log-likelihood ratios with their thresholds."""
    figure, (map_axes, ratio_axes) = new_figure(title, (13.0, 6.4), (1.0, 1.15))
    ends = np.cumsum(recording.lengths)
    _style_map(map_axes, "Trajectory; labels: true mode of each piece")
    map_axes.plot(*recording.measurements[RUN].T, ".", color=GREY, markersize=2.5, alpha=0.6, zorder=1)
    truth = recording.truth[RUN][:, [0, 2]]
    map_axes.plot(*truth.T, color=TRUTH, linewidth=3.4, zorder=2)
    middles = [  # the middle half of each piece, for its label
        map_axes.plot(*truth[end - 3 * length // 4 : end - length // 4].T, color=TRUTH, linewidth=3.4)[0]
        for end, length in zip(ends, recording.lengths, strict=True)
    ]
    estimate = tracks.estimates[RUN][:, [0, 2]]
    modes = tracks.modes[RUN]
    lines = _plot_by_mode(map_axes, estimate, modes, radii, linewidth=1.5, zorder=3)
    worst = np.hypot(*(estimate - truth).T).argmax()
    labelled = lines[np.count_nonzero(np.diff(modes[: worst + 1]))]  # the line with the largest error
    decided = ~tracks.undecided[RUN]
    decision_ticks = (ends - recording.lengths + tracks.ticks[RUN])[decided]
    map_axes.plot(
        *estimate[decision_ticks - 1].T, "o", markersize=5, markerfacecolor="white", markeredgecolor="black",
        zorder=4,
    )  # fmt: skip
    map_axes.plot(*truth[0], "s", color="black", markersize=6, zorder=4)

    _draw_ratios(ratio_axes, recording, tracks, radii, alpha)
    handles = [
        Line2D([], [], color="black", marker="s", linestyle="none", markersize=6, label="start"),
        Line2D([], [], color=GREY, marker=".", linestyle="none", label="measurements"),
        Line2D([], [], color=TRUTH, linewidth=3.4, label="true trajectory"),
        *(
            Line2D([], [], color=colour, linewidth=2, label=name)
            for colour, name in zip(TYPE_COLOURS, TYPE_NAMES, strict=True)
        ),
        Line2D(
            [], [], marker="o", markerfacecolor="white", markeredgecolor="black", linestyle="none",
            markersize=5, label="decision",
        ),
    ]  # fmt: skip
    shades = "; darker shades: smaller radii" if len(radii) > 1 else ""
    figure.legend(
        handles=handles, loc="outside lower center", ncols=len(handles), frameon=False,
        title=f"Colours: active mode of the estimate (left) and hypothesis (right){shades}",
    )  # fmt: skip
    names = [
        f"{number}: {_mode_label(radius)}" for number, radius in enumerate(recording.signed_radii, start=1)
    ]
    label_curves(map_axes, [*zip(middles, names, strict=True), (labelled, "estimate")])
    return figure


def _decimal(value: float) -> str:
    """One decimal, with the minus sign of the axes."""
    return f"{value:.1f}".replace("-", "\N{MINUS SIGN}")


def _draw_ratios(axes: Any, recording: Any, tracks: Any, radii: Sequence[float], alpha: float) -> None:
    """Log-likelihood ratio of every hypothesis to the active mode, up to the decision of each piece."""
    ratios = tracks.ratios[RUN]
    ticks = np.arange(1, len(ratios) + 1)
    for mode in range(2 * len(radii) + 1):
        axes.plot(ticks, ratios[:, mode], color=mode_colour(mode, radii), linewidth=0.9)
    upper, lower = sprt_thresholds(alpha)
    for name, threshold in (("ln A", upper), ("ln B", lower)):
        axes.axhline(threshold, color="0.3", linestyle="--", linewidth=0.9, zorder=1)
        axes.annotate(
            f"{name}\n{_decimal(threshold)}", (1.0, threshold), xycoords=("axes fraction", "data"),
            xytext=(4, 0), textcoords="offset points", va="center",
        )  # fmt: skip
    ends = np.cumsum(recording.lengths)
    for end in ends[:-1]:
        axes.axvline(end + 0.5, color="0.75", linewidth=0.8, zorder=0)
    pieces = axes.secondary_xaxis("top")
    pieces.set_xticks(ends - recording.lengths / 2, [str(number) for number in range(1, len(ends) + 1)])
    pieces.tick_params(length=0, pad=-16)  # inside the axes
    axes.set(
        title=f"Sequential tests of pieces 1 to {len(ends)}, each until its decision", xlabel="tick",
        ylabel="log-likelihood ratio to the active mode", xlim=(0, len(ratios)),
        ylim=(2.0 * lower, 2.0 * upper),
    )  # fmt: skip


def _detection_figure(result: Reproduction) -> dict[str, Figure]:
    """Trajectory with its measurements, ln lambda of one run, and distribution of the delay."""
    switch = golubkov2020.SWITCH
    figure, (map_axes, ratio_axes, delay_axes) = new_figure(
        f"{result.paper}: detection of a right turn (r = 5 m) that begins after tick {switch}",
        (15.5, 5.2), (0.9, 1.2, 1.2),
    )  # fmt: skip
    recording, detection = next(iter(result.examples.values()))
    alpha = golubkov2020.ALPHAS[0]
    modes = np.repeat([0, golubkov2020.RIGHT_TURN], recording.lengths)
    _style_map(map_axes, "One run in the plane")
    (measured,) = map_axes.plot(*recording.measurements[RUN].T, ".", color=GREY, markersize=4)
    paths = _plot_by_mode(map_axes, recording.truth[RUN][:, [0, 2]], modes, (5.0,), linewidth=1.8)

    log_ratios = detection.log_ratios[RUN][:, golubkov2020.RIGHT_TURN]
    ticks = np.arange(1, len(log_ratios) + 1)
    ratio_axes.plot(ticks, log_ratios, color=TYPE_COLOURS[2])
    labels = [
        (
            ratio_axes.axhline(value, color=DARK_GREY, linestyle="--", linewidth=0.9),
            f"{name} = {_decimal(value)}",
        )
        for value, name in ((detection.upper, "ln A"), (detection.lower, "ln B"))
    ]
    labels.append((ratio_axes.axvline(switch + 0.5, color=GREY, linewidth=0.9, zorder=0), "turn begins"))
    tick = int(detection.ticks[RUN])
    if tick:
        (detected,) = ratio_axes.plot(
            tick, log_ratios[tick - 1], "o", color=TRUTH, markersize=6, markerfacecolor="white"
        )
        labels.append((detected, f"detected at tick {tick}"))
    ratio_axes.set(
        title=f"The same run: averaged likelihood ratio λ, alpha = {alpha:g}", xlabel="tick",
        ylabel="ln λ of a right turn against straight motion",
    )  # fmt: skip

    curves = []
    for (name, (_, found)), colour, style in zip(
        result.examples.items(), ALPHA_COLOURS, ALPHA_LINES, strict=True
    ):
        delays = found.ticks[found.ticks > switch] - switch
        share = [100.0 * (delays <= delay).sum() / result.runs for delay in range(switch + 1)]
        corners = np.repeat(np.arange(switch + 2), 2)[1:-1]
        (curve,) = delay_axes.plot(corners, np.repeat(share, 2), color=colour, linestyle=style, linewidth=1.6)
        curves.append((curve, name))
    published = delay_axes.axvline(golubkov2020.PUBLISHED_DELAY, color=GREY, linewidth=1.0, zorder=0)
    delay_axes.set(
        title=f"{result.runs} runs: distribution of the delay", xlabel="delay since the turn began [ticks]",
        ylabel="runs with the turn detected [%]", xlim=(0, 1.35 * switch), ylim=(0, 100),
    )  # fmt: skip
    delay_axes.set_xticks(range(0, switch + 1, 5))

    label_curves(map_axes, [(measured, "measurements"), (paths[0], "straight"), (paths[1], "right turn")])
    label_curves(ratio_axes, labels)
    label_curves(delay_axes, [*curves, (published, f"published: {golubkov2020.PUBLISHED_DELAY}")])
    return {"golubkov2020.png": figure}


FIGURES: dict[str, Callable[[Reproduction], dict[str, Figure]]] = {
    "golubkov2018": partial(
        _tracking_figures, "golubkov2018", golubkov2018.MEASUREMENT_VARIANCES, golubkov2018.RADII,
        golubkov2018.ALPHA,
    ),
    "tsyganov2019": partial(
        _tracking_figures, "tsyganov2019", tsyganov2019.MEASUREMENT_VARIANCES, (tsyganov2019.RADIUS,),
        tsyganov2019.ALPHA,
    ),
    "golubkov2020": _detection_figure,
    "zimchuk": zimchuk_figure.draw,
    "novospaskyi": novospaskyi_figures.draw,
}  # fmt: skip
"""What draws the figures of each paper, by their file names."""
