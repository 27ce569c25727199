"""Figure of the decision times over the measurement noise."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure as Canvas
from matplotlib.transforms import ScaledTranslation

from agents.interface.curve_labels import label_curves
from agents.interface.decider_colours import DeciderStyle, decider_styles
from agents.interface.output_files import atomic_file
from agents.limits.study import BANKS, NOISE_LEVELS, RuleResult

MARKER_SPACING = 10.0  # between the markers of rules that do not reach the accuracy [pt]


def draw_decision_times(found: Sequence[RuleResult], path: Path) -> None:
    """Write `decision_times` as PNG."""
    canvas = decision_times(found)
    with atomic_file(path) as part:
        canvas.savefig(part)


def decision_times(found: Sequence[RuleResult]) -> Canvas:
    """Mean decision time at 98 % accuracy over the noise, one row per environment, one column per bank.

    Rules that do not reach 98 % at a noise level have a hollow marker in the strip at the top.
    """
    environments = list(dict.fromkeys(one.env_id for one in found))
    styles = decider_styles(dict.fromkeys(one.rule for one in found))
    canvas = Canvas(figsize=(11.5, 3.9 * len(environments)), layout="constrained", dpi=120)
    FigureCanvasAgg(canvas)
    panels = canvas.subplots(len(environments), len(BANKS), sharex=True, sharey="row", squeeze=False)
    curves = []
    for row, env_id in zip(panels, environments, strict=True):
        results = [one for one in found if one.env_id == env_id]
        times = [one.time_98.value for one in results if np.isfinite(one.time_98.value)]
        top = 5.0 * np.ceil(max(times, default=10.0) / 5.0)
        for axes, bank in zip(row, BANKS, strict=True):
            here = [one for one in results if one.bank == bank]
            curves.append((axes, _draw_bank(axes, here, styles, 1.09 * top)))
            axes.axhline(1.03 * top, color="0.4", linewidth=0.8)
            axes.set_ylim(0, 1.15 * top)
            ticks = np.arange(0, top + 1, 10)
            axes.set_yticks([*ticks, 1.09 * top], [f"{tick:g}" for tick in ticks] + ["not reached"])
            axes.set_title(f"{env_id.rpartition(':')[2]}, {bank.replace('_', '-')} bank", fontsize=11)
            axes.spines[["top", "right"]].set_visible(False)
            axes.grid(alpha=0.25)
        row[0].set_ylabel("mean decision time\nat 98 % accuracy, ticks")
    for axes in panels[-1]:
        axes.set_xscale("log")
        axes.set_xlim(0.7 * NOISE_LEVELS[0], 1.5 * NOISE_LEVELS[-1])
        axes.set_xticks(NOISE_LEVELS, [f"{noise:g}" for noise in NOISE_LEVELS])
        axes.set_xticks([], minor=True)
        axes.set_xlabel("measurement variance R, m²")
    for axes, lines in curves:
        label_curves(axes, lines)
    return canvas


def _draw_bank(
    axes: Any, found: Sequence[RuleResult], styles: Mapping[str, DeciderStyle], not_reached: float
) -> list[tuple[Any, str]]:
    """Draw every rule of a panel; coinciding lines remain visible, as the last is dashed.

    Returns:
        The lines to label, with their labels.
    """
    lines = []
    missing: dict[float, int] = {}
    rules = list(dict.fromkeys(one.rule for one in found))
    for index, rule in enumerate(rules):
        results = [one for one in found if one.rule == rule]
        style = styles[rule]
        (line,) = axes.plot(
            [one.noise for one in results], [one.time_98.value for one in results], color=style.colour,
            marker=style.marker, markersize=8.5 - 1.3 * index, linewidth=1.8,
            linestyle="--" if rule == rules[-1] else "-",
        )  # fmt: skip
        reached = any(np.isfinite(one.time_98.value) for one in results)
        if reached:
            lines.append((line, rule))
        for one in results:
            if np.isfinite(one.time_98.value):
                continue
            shift = MARKER_SPACING * missing.get(one.noise, 0)
            missing[one.noise] = missing.get(one.noise, 0) + 1
            side = -1 if one.noise == NOISE_LEVELS[-1] else 1  # towards the middle of the panel
            offset = ScaledTranslation(side * shift / 72, 0, axes.figure.dpi_scale_trans)
            (marker,) = axes.plot(
                one.noise, not_reached, marker=style.marker, markersize=6, color=style.colour,
                markerfacecolor="white", transform=axes.transData + offset, linestyle="none",
            )  # fmt: skip
            if not reached and one is results[0]:
                lines.append((marker, rule))
    return lines
