"""Delay and reward against the rate of wrong changes, one curve per decider."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure as Canvas
from matplotlib.ticker import FuncFormatter, NullFormatter
from numpy.typing import NDArray

from agents.comparison.figure import DPI, draw_curve, mark_edges
from agents.comparison.statement_study import EQUAL_WRONG_CHANGES, StatementComparison, StatementEntry
from agents.evaluation.statement_curve import FULL_DELAY, REWARD, WRONG_CHANGES, Statistic, mean_of
from agents.interface.curve_labels import label_curves
from agents.interface.decider_colours import decider_styles
from agents.interface.output_files import atomic_file

FloatArray = NDArray[np.float64]
RATES = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0)
PANELS = {
    "mean delay of a switch, ticks": FULL_DELAY,
    "mean reward of a tick": mean_of(REWARD),
}


def draw_tradeoff(result: StatementComparison, path: Path) -> None:
    """Write `tradeoff` as PNG."""
    canvas = tradeoff(result)
    with atomic_file(path) as part:
        canvas.savefig(part)


def tradeoff(result: StatementComparison) -> Canvas:
    """Mean delay and mean reward against wrong changes per 1,000 ticks, as the threshold sweeps.

    The delay of a switch that is not detected is that to the end of its segment. Otherwise a strict threshold
    would detect only the easiest switches and seem quick. Bands are 95 % bootstrap confidence intervals over
    tracks. Filled markers are the thresholds selected on other tracks. Arrows mark where a curve leaves the
    axes. A dashed line marks the rate at which delays are compared.
    """
    canvas = Canvas(figsize=(11.5, 5.2), layout="constrained", dpi=DPI)
    FigureCanvasAgg(canvas)
    panels = canvas.subplots(1, 2)
    names = [entry.name for entry in result.entries]
    styles = decider_styles(names)
    drawn = []
    for axes, (label, statistic) in zip(panels, PANELS.items(), strict=True):
        curves = []
        for entry in result.entries:
            rates, values, bounds = _points(entry, statistic)
            if not rates.size:
                continue
            rate = entry.figures.estimates["wrong_changes"].value
            selected = [(rate, float(entry.curve.values(statistic)[entry.chosen]))] if rate > 0.0 else []
            line = draw_curve(axes, rates, values, bounds, selected, styles[entry.name])
            curves.append((line, entry.name))
        axes.axvline(EQUAL_WRONG_CHANGES, color="0.75", linewidth=0.8, linestyle="--", zorder=0)
        _set_limits(axes, result.entries, statistic)
        axes.set_xlabel("wrong changes per 1,000 ticks")
        axes.set_ylabel(label)
        axes.grid(alpha=0.25)
        axes.spines[["top", "right"]].set_visible(False)
        drawn.append((axes, curves))
    panels[0].set_title("Delay against wrong changes")
    panels[1].set_title(f"Mean reward, a wrong change costs {result.world.change_cost:g} ticks")
    variances = " and ".join(f"{variance:g}" for variance in result.world.variances)
    canvas.suptitle(
        f"{result.plan.env_id.removeprefix('hybrid_env:')}: {result.world.hypotheses} hypotheses, "
        f"R = {variances} m², segments of {result.world.law} ticks"
    )
    canvas.supxlabel(
        "Filled markers: thresholds selected on other tracks. Arrows: the curve continues outside the axes. "
        "A switch that is not detected counts until the end of its segment.",
        fontsize=9,
        color="0.3",
    )
    for axes, curves in drawn:
        for line, _ in curves:
            mark_edges(axes, line)
        label_curves(axes, curves)
    return canvas


def _points(entry: StatementEntry, statistic: Statistic) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Rates (K,), values (K,) and bounds (2, K) at the thresholds with a wrong change."""
    rates = entry.curve.values(mean_of(WRONG_CHANGES))
    shown = np.flatnonzero(rates > 0.0)
    estimates = [entry.curve.at(index).estimate(statistic) for index in shown.tolist()]
    values = np.array([[one.value, one.low, one.high] for one in estimates]).reshape(-1, 3)
    return rates[shown], values[:, 0], values[:, 1:].T


def _set_limits(axes: Any, entries: Sequence[StatementEntry], statistic: Statistic) -> None:
    """Limits that show the selected thresholds and the compared rate, and all values around them."""
    chosen = [entry.figures.estimates["wrong_changes"].value for entry in entries]
    chosen = [rate for rate in chosen if rate > 0.0] + [EQUAL_WRONG_CHANGES]
    low, high = min(chosen) / 3.0, max(chosen) * 3.0
    axes.set_xscale("log")
    axes.set_xlim(low, high)
    axes.set_xticks([rate for rate in RATES if low <= rate <= high])
    axes.xaxis.set_major_formatter(FuncFormatter(lambda rate, _: f"{rate:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    shown = [
        value
        for entry in entries
        for rate, value in zip(
            entry.curve.values(mean_of(WRONG_CHANGES)), entry.curve.values(statistic), strict=True
        )
        if min(chosen) / 1.7 <= rate <= high
    ]
    margin = 0.06 * (max(shown) - min(shown))
    axes.set_ylim(min(shown) - margin, max(shown) + margin)
