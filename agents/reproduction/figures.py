"""The papers' figures, drawn from the reproduction's own recordings."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from agents.interface.output_files import whole_file
from baselines.deciders.sprt import sprt_thresholds
from baselines.papers import golubkov2018, golubkov2020, tsyganov2019
from baselines.papers.reproduction import Reproduction
from hybrid_env.rendering.modes import TYPE_COLOURS, mode_colour
from hybrid_env.scheme import nearest_mode

NAMES = ("straight", "left turn", "right turn")
RUN = 0  # of the study, the one that is drawn
GREY = "#9a9a9a"


def draw_figures(paper: str, result: Reproduction, folder: Path) -> list[str]:
    """Draw a paper's figures as PNG and return their names."""
    if paper == "golubkov2020":
        figures = {"golubkov2020.png": _detection_figure(result)}
    else:
        settings: dict[str, tuple[Sequence[float], float]] = {
            "golubkov2018": (golubkov2018.RADII, golubkov2018.ALPHA),
            "tsyganov2019": ((tsyganov2019.RADIUS,), tsyganov2019.ALPHA),
        }
        radii, alpha = settings[paper]
        figures = {
            f"{paper}_{index}.png": _tracking_figure(
                f"{result.paper}, {name}", recording, found, radii, alpha
            )
            for index, (name, (recording, found)) in enumerate(result.pictures.items(), start=1)
        }
    for name, figure in figures.items():
        with whole_file(folder / name) as part:
            figure.savefig(part, dpi=110)
    return list(figures)


def _figure(title: str, widths: Sequence[float]) -> tuple[Figure, Any]:
    figure = Figure(figsize=(4.6 * sum(widths), 4.8), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(title)
    return figure, figure.subplots(1, len(widths), width_ratios=widths)


def _draw_way(
    axes: Any, positions: NDArray[np.float64], modes: NDArray[np.int64], radii: Sequence[float]
) -> None:
    """A path coloured by mode, one line for each stretch."""
    ends = np.flatnonzero(np.diff(modes)) + 1
    for first, last in zip([0, *ends], [*ends, len(modes)], strict=True):
        stretch = positions[max(first - 1, 0) : last]
        axes.plot(*stretch.T, color=mode_colour(int(modes[first]), radii), linewidth=1.8)


def _style_map(axes: Any, title: str) -> None:
    axes.set(title=title, xlabel="x [m]", ylabel="y [m]")
    axes.set_aspect("equal", adjustable="datalim")
    axes.grid(alpha=0.25)


def _tracking_figure(title: str, recording: Any, found: Any, radii: Sequence[float], alpha: float) -> Figure:
    """Trajectory by mode, estimate over measurements, likelihood ratios with thresholds."""
    figure, (true_axes, found_axes, ratio_axes) = _figure(title, (1.0, 1.0, 1.4))
    true_modes = np.repeat(
        [nearest_mode(radius, radii) for radius in recording.signed_radii], recording.lengths
    )
    _draw_way(true_axes, recording.truth[RUN][:, [0, 2]], true_modes, radii)
    _style_map(true_axes, "trajectory")
    found_axes.plot(*recording.measurements[RUN].T, ".", color=GREY, markersize=2.5, alpha=0.7)
    _draw_way(found_axes, found.estimates[RUN][:, [0, 2]], found.modes[RUN], radii)
    _style_map(found_axes, "measurements and estimate")

    ticks = np.arange(1, len(found.ratios[RUN]) + 1)
    for mode in range(2 * len(radii) + 1):
        ratio_axes.plot(ticks, found.ratios[RUN][:, mode], color=mode_colour(mode, radii), linewidth=0.9)
    upper, lower = sprt_thresholds(alpha)
    for threshold in (upper, lower):
        ratio_axes.axhline(threshold, color="0.3", linestyle="--", linewidth=0.9)
    for switch in np.cumsum(recording.lengths)[:-1]:
        ratio_axes.axvline(switch + 0.5, color="0.8", linewidth=0.8, zorder=0)
    ratio_axes.set(
        title="log-likelihood ratios to the active mode", xlabel="tick", ylim=(2.0 * lower, 2.0 * upper),
        xlim=(0, len(ticks)),
    )  # fmt: skip
    handles = [ratio_axes.plot([], [], color=colour, linewidth=2)[0] for colour in TYPE_COLOURS]
    figure.legend(handles, NAMES, loc="outside lower center", ncols=3, frameon=False)
    return figure


def _detection_figure(result: Reproduction) -> Figure:
    """A trajectory with its measurements, ln lambda with thresholds, and the delays of all runs."""
    figure, (way_axes, ratio_axes, delay_axes) = _figure(
        f"{result.paper}, R20 r = 5 m after S20", (1.0, 1.2, 1.2)
    )
    recording, found = next(iter(result.pictures.values()))
    modes = np.repeat([0, golubkov2020.RIGHT_TURN], recording.lengths)
    way_axes.plot(*recording.measurements[RUN].T, ".", color=GREY, markersize=4)
    _draw_way(way_axes, recording.truth[RUN][:, [0, 2]], modes, (5.0,))
    _style_map(way_axes, "trajectory and measurements")

    ticks = np.arange(1, found.log_ratios.shape[1] + 1)
    ratio_axes.plot(ticks, found.log_ratios[RUN][:, golubkov2020.RIGHT_TURN], color=TYPE_COLOURS[2])
    for threshold, name in ((found.upper, "ln A"), (found.lower, "ln B")):
        ratio_axes.axhline(threshold, color="0.3", linestyle="--", linewidth=0.9)
        ratio_axes.annotate(name, (1.0, threshold), xytext=(0, 3), textcoords="offset points")
    ratio_axes.axvline(golubkov2020.SWITCH + 0.5, color="0.7", linewidth=0.9)
    ratio_axes.set(title=f"averaged ratio ln λ, alpha = {golubkov2020.ALPHAS[0]:g}", xlabel="tick")

    bins = np.arange(0.5, golubkov2020.SWITCH + 1.0)
    for name, (_, detection) in result.pictures.items():
        delays = detection.ticks[detection.ticks > golubkov2020.SWITCH] - golubkov2020.SWITCH
        delay_axes.hist(
            delays,
            bins,
            histtype="step",
            linewidth=1.6,
            label=name,
            weights=np.full(len(delays), 100 / result.runs),
        )
    delay_axes.axvline(golubkov2020.PUBLISHED_DELAY, color="0.3", linestyle=":", label="published, one run")
    delay_axes.set(title="delay of the detection", xlabel="ticks after the switch", ylabel="% of runs")
    delay_axes.legend(frameon=False, loc="upper left")
    return figure
