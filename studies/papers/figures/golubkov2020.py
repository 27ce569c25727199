"""Figure of Golubkov 2020: the trajectory, ln lambda of one run, and the distribution of the
delay.
"""

import numpy as np
from matplotlib.figure import Figure

from agents.figures.canvas import DARK_GREY, GREY, TRUTH, paper_figure, style_map
from agents.figures.tracks import draw_by_mode
from hybrid_env.rendering.evidence import TYPE_COLOURS
from studies.papers.figures.golubkov2018 import RUN, decimal
from studies.papers.golubkov2020 import ALPHAS, PUBLISHED_DELAY, RIGHT_TURN, SWITCH
from studies.papers.reproduction import Reproduction

ALPHA_STYLES = (
    {"color": "#000000", "linestyle": "-"},
    {"color": "#4477AA", "linestyle": "--"},
    {"color": "#CCBB44", "linestyle": "-."},
    {"color": "#AA3377", "linestyle": ":"},
)
"""Line of each value of alpha."""


def draw(result: Reproduction) -> dict[str, Figure]:
    """Return the figure by its file name."""
    title = f"{result.paper}: detection of a right turn (r = 5 m) that begins after tick {SWITCH}"
    figure, (map_axes, ratio_axes, delay_axes) = paper_figure(title, (15.5, 5.2), (0.9, 1.2, 1.2))
    recording, detection = next(iter(result.examples.values()))
    modes = np.repeat([0, RIGHT_TURN], recording.lengths)
    style_map(map_axes, "One run in the plane")
    map_axes.plot(
        *recording.measurements[RUN].T,
        ".",
        color=GREY,
        markersize=4,
        label="measurements",
    )
    draw_by_mode(map_axes, recording.truth[RUN][:, [0, 2]], modes, TYPE_COLOURS, linewidths=1.8)
    for mode, name in (
        (0, "straight"),
        (RIGHT_TURN, "right turn"),
    ):
        map_axes.plot([], [], color=TYPE_COLOURS[mode], label=name)

    log_ratios = detection.log_ratios[RUN][:, RIGHT_TURN]
    ticks = np.arange(1, len(log_ratios) + 1)
    ratio_axes.plot(ticks, log_ratios, color=TYPE_COLOURS[2])
    for value, name in (
        (detection.upper, "ln A"),
        (detection.lower, "ln B"),
    ):
        label = f"{name} = {decimal(value)}"
        ratio_axes.axhline(
            value,
            color=DARK_GREY,
            linestyle="--",
            linewidth=0.9,
            label=label,
        )
    ratio_axes.axvline(
        SWITCH + 0.5,
        color=GREY,
        linewidth=0.9,
        zorder=0,
        label="turn begins",
    )
    tick = int(detection.ticks[RUN])
    if tick:
        label = f"detected at tick {tick}"
        ratio_axes.plot(
            tick,
            log_ratios[tick - 1],
            "o",
            color=TRUTH,
            markersize=6,
            markerfacecolor="white",
            label=label,
        )
    ratio_axes.set(
        title=f"The same run: averaged likelihood ratio λ, alpha = {ALPHAS[0]:g}",
        xlabel="tick",
        ylabel="ln λ of a right turn against straight motion",
    )

    for (name, (_, found)), style in zip(result.examples.items(), ALPHA_STYLES, strict=True):
        delays = found.ticks[found.ticks > SWITCH] - SWITCH
        share = [100.0 * (delays <= delay).sum() / result.runs for delay in range(SWITCH + 1)]
        corners = np.repeat(np.arange(SWITCH + 2), 2)[1:-1]
        delay_axes.plot(corners, np.repeat(share, 2), linewidth=1.6, label=name, **style)
    label = f"published: {PUBLISHED_DELAY}"
    delay_axes.axvline(
        PUBLISHED_DELAY,
        color=GREY,
        linewidth=1.0,
        zorder=0,
        label=label,
    )
    delay_axes.set(
        title=f"{result.runs} runs: distribution of the delay",
        xlabel="delay since the turn began [ticks]",
        ylabel="runs with the turn detected [%]",
        xlim=(0, 1.35 * SWITCH),
        ylim=(0, 100),
    )
    delay_axes.set_xticks(range(0, SWITCH + 1, 5))

    for axes in (map_axes, ratio_axes, delay_axes):
        axes.legend()
    return {"golubkov2020.png": figure}
