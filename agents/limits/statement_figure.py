"""Figure of the reward of a statement against the number of later ticks that it may use."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure as Canvas

from agents.interface.curve_labels import label_curves
from agents.interface.decider_colours import decider_styles
from agents.interface.output_files import atomic_file
from agents.limits.statement_study import BEAM, GEOMETRIC, IMM, LATER, LAWS, THRESHOLD, StatementStep
from agents.limits.study import NOISE_LEVELS

NAMES = {
    IMM: "IMM",
    THRESHOLD: "IMM threshold",
    GEOMETRIC: "beam, geometric",
    BEAM: "beam",
}
"""Labels, which are the names of the deciders in other figures."""


def draw_statement_limits(found: Sequence[StatementStep], path: Path) -> None:
    """Write `statement_limits` as PNG."""
    canvas = statement_limits(found)
    with atomic_file(path) as part:
        canvas.savefig(part)


def statement_limits(found: Sequence[StatementStep]) -> Canvas:
    """Mean reward of a tick against the later ticks known, one row per law, one column per noise level.

    The curve of the beam that knows the law begins with its reward on line. The other lines are the rules
    below it, dotted without a threshold. Bars are 95 % confidence intervals.
    """
    canvas = Canvas(figsize=(11.5, 3.7 * len(LAWS)), layout="constrained", dpi=120)
    FigureCanvasAgg(canvas)
    panels = canvas.subplots(len(LAWS), len(NOISE_LEVELS), sharex=True, sharey=True, squeeze=False)
    drawn = []
    for row, law in zip(panels, LAWS, strict=True):
        for axes, noise in zip(row, NOISE_LEVELS, strict=True):
            here = {one.step: one for one in found if (one.law, one.noise) == (law, noise)}
            drawn.append((axes, _draw_panel(axes, here)))
            axes.set_title(f"durations {law}, R = {noise:g} m²", fontsize=10)
            axes.grid(alpha=0.25)
            axes.spines[["top", "right"]].set_visible(False)
        row[0].set_ylabel("mean reward of a tick")
    for axes in panels[-1]:
        axes.set_xlabel("later ticks known")
    for axes, lines in drawn:
        label_curves(axes, lines)
    return canvas


def _draw_panel(axes: Any, steps: dict[str, StatementStep]) -> list[tuple[Any, str]]:
    """Draw the steps of one law and noise level. Returns the lines to label, with their labels."""
    styles = decider_styles(NAMES.values())
    lags = [0, *LATER]
    rewards = [steps[step].reward for step in (BEAM, *LATER.values())]
    values = [reward.value for reward in rewards]
    bars = np.abs([[one.low - one.value for one in rewards], [one.high - one.value for one in rewards]])
    style = styles[NAMES[BEAM]]
    axes.errorbar(lags, values, bars, color=style.colour, linestyle="none", linewidth=1)
    (curve,) = axes.plot(lags, values, color=style.colour, marker=style.marker, markersize=5)
    lines = [(curve, NAMES[BEAM])]
    for step in (GEOMETRIC, THRESHOLD, IMM):
        level, dashes = steps[step].reward.value, ":" if step == IMM else "--"
        colour = styles[NAMES[THRESHOLD if step == IMM else step]].colour  # the same bank
        (line,) = axes.plot([lags[0], lags[-1]], [level] * 2, color=colour, linestyle=dashes, linewidth=1.4)
        lines.append((line, NAMES[step]))
    return lines
