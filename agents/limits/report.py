"""The limits as Markdown and a figure."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure as Canvas

from agents.evaluation.operating_curve import Estimate
from agents.interface.output_files import whole_file
from agents.limits.study import BANKS, NOISE, STATEMENT_TICKS, Classes, Limit, Stated

COLOURS = {"published": "#4477AA", "anchor_aware": "#EE6677", "oracle": "#228833"}
MARKERS = ("o", "D", "s", "^")


def _cell(figure: Estimate, digits: int) -> str:
    if not np.isfinite(figure.value):
        return "not reached"
    return f"{figure.value:.{digits}f} [{figure.low:.{digits}f}, {figure.high:.{digits}f}]"


def limits_markdown(found: Sequence[Limit]) -> str:
    """Times and rewards, a row for each rule on each bank, a column for each noise."""
    lines = []
    for env_id in dict.fromkeys(one.env_id for one in found):
        ours = [one for one in found if one.env_id == env_id]
        segments = "mean ticks at 95 % / at 98 % accuracy; best reward a segment"
        lines += [f"### {env_id.rpartition(':')[2]}", "", segments + ".", ""]
        lines += ["| bank | rule | " + " | ".join(f"R = {noise:g}" for noise in NOISE) + " |"]
        lines += ["|---|---|" + "---|" * len(NOISE)]
        for bank in BANKS:
            for rule in dict.fromkeys(one.rule for one in ours):
                cells = []
                for noise in NOISE:
                    for one in ours:
                        if (one.bank, one.rule, one.noise) == (bank, rule, noise):
                            times = f"{_cell(one.time_95, 1)} / {_cell(one.time_98, 1)}"
                            cells.append(f"{times}; {_cell(one.reward, 3)}")
                lines.append(f"| {bank.replace('_', '-')} | {rule} | " + " | ".join(cells) + " |")
        lines.append("")
    return "\n".join(lines)


def statements_markdown(found: Sequence[Stated]) -> str:
    """Stated and actual probability by bank, noise and tick."""
    heads = [f"after {tick} ticks" for tick in STATEMENT_TICKS]
    lines = ["| bank | R | " + " | ".join(heads) + " |", "|---|---|" + "---|" * len(heads)]
    for bank, noise in dict.fromkeys((one.bank, one.noise) for one in found):
        cells = []
        for one in found:
            if (one.bank, one.noise) == (bank, noise):
                told = one.statement
                cells.append(f"{100 * told.right:.1f} / {100 * told.stated:.1f} ({100 * told.worst:+.1f})")
        lines.append(f"| {bank} | {noise:g} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def classes_markdown(found: Sequence[Classes]) -> str:
    """Right types of the gap rule on the scheme of 2018."""
    lines = ["| bank | R | right types, % | mean ticks |", "|---|---|---|---|"]
    for one in found:
        scaled = Estimate(100 * one.right.value, 100 * one.right.low, 100 * one.right.high)
        lines.append(
            f"| {one.bank.replace('_', '-')} | {one.noise:g} | {_cell(scaled, 1)} | {one.ticks:.1f} |"
        )
    return "\n".join(lines) + "\n"


def draw_limits(found: Sequence[Limit], path: Path) -> None:
    """Mean ticks at 98 % accuracy over the noise: a colour a bank, a marker a rule."""
    environments = list(dict.fromkeys(one.env_id for one in found))
    canvas = Canvas(figsize=(6.4 * len(environments), 5.6), layout="constrained")
    FigureCanvasAgg(canvas)
    for axes, env_id in zip(np.atleast_1d(canvas.subplots(1, len(environments))), environments, strict=True):
        ours = [one for one in found if one.env_id == env_id]
        for bank in BANKS:
            for index, rule in enumerate(dict.fromkeys(one.rule for one in ours)):
                line = [one for one in ours if (one.bank, one.rule) == (bank, rule)]
                times = [one.time_98.value for one in line]
                axes.plot(
                    [one.noise for one in line], times, color=COLOURS[bank], marker=MARKERS[index],
                    linestyle=("-", "--", ":", "-.")[index], markersize=5,
                    label=f"{bank.replace('_', '-')}, {rule}",
                )  # fmt: skip
        axes.set_xscale("log")
        axes.set_xlabel("R, m²")
        axes.set_ylabel("mean ticks at 98 % accuracy")
        axes.set_ylim(bottom=0)
        axes.set_title(env_id.rpartition(":")[2])
        axes.grid(alpha=0.25)
        axes.spines[["top", "right"]].set_visible(False)
        axes.legend(
            frameon=False, fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=len(BANKS)
        )
    with whole_file(path) as part:
        canvas.savefig(part, dpi=120)
