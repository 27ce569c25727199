"""Figures of comparisons."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure as Canvas
from numpy.typing import NDArray

from agents.evaluation.evaluate import interval
from agents.evaluation.operating_curve import ACCURACY, REWARD, TICKS
from agents.interface.decider_colours import COLOURS, MARKERS
from agents.interface.output_files import whole_file

if TYPE_CHECKING:
    from agents.comparison.study import Comparison, Entry

ERROR_TICKS = (0.5, 0.3, 0.2, 0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001)


def draw_operating_curves(result: "Comparison", path: Path) -> None:
    """Accuracy and reward against mean decision ticks, one curve a decider, as PNG.

    Accuracy is drawn as the logarithm of the error, so that 98 % and 99 % stand apart. Agents that differ
    only in the seed of their training are one curve, their mean, with their range as its band; other bands
    are 95 % bootstrap intervals over episodes. Filled markers are thresholds chosen on other episodes.
    """
    canvas = Canvas(figsize=(11, 4.8), layout="constrained")
    FigureCanvasAgg(canvas)
    left, right = canvas.subplots(1, 2)
    ends = []
    for index, (kind, entries) in enumerate(result.by_kind().items()):
        colour, marker = COLOURS[index % len(COLOURS)], MARKERS[index % len(MARKERS)]
        means = np.mean([entry.curve.means for entry in entries], axis=0)
        ticks, accuracy, reward = means[TICKS], means[ACCURACY], means[REWARD]
        # no error in n segments is drawn at half an error
        least = 0.5 / entries[0].curve.decisions[0].correct.size
        left.fill_between(
            ticks, *np.maximum(1.0 - _band(entries, ACCURACY), least), color=colour, alpha=0.2, linewidth=0
        )
        right.fill_between(ticks, *_band(entries, REWARD), color=colour, alpha=0.2, linewidth=0)
        label = kind if len(entries) == 1 else f"{kind}, {len(entries)} seeds"
        for axes, values in ((left, np.maximum(1.0 - accuracy, least)), (right, reward)):
            axes.plot(
                ticks,
                values,
                color=colour,
                marker=marker,
                markersize=4.5,
                markerfacecolor="white",
                label=label,
            )
        for entry in entries:
            point = entry.curve.means[:, entry.chosen]
            for axes, value in ((left, max(1.0 - point[ACCURACY], least)), (right, point[REWARD])):
                axes.plot(point[TICKS], value, color=colour, marker=marker, markersize=8, zorder=5)
        ends.append(float(np.interp(0.998, accuracy, ticks)) if accuracy.max() > 0.9 else float(ticks.max()))

    latest = 1.05 * max(30.0, max(ends))
    left.set_yscale("log")
    left.set_ylim(0.6, 0.8e-3)
    left.set_yticks(ERROR_TICKS, [f"{100 * (1 - error):g}" for error in ERROR_TICKS], minor=False)
    left.set_yticks([], minor=True)
    for level in (0.95, 0.98):
        left.axhline(1.0 - level, color="0.75", linewidth=0.8, linestyle="--", zorder=0)
    left.set_ylabel("accuracy, % of segments")
    left.set_title("Sooner is left, righter is up")
    right.set_ylabel("mean reward a segment")
    right.set_title(f"Delay costs {result.world.delay_cost:g} a tick")
    best = max(entry.reward.value for entry in result.entries)
    right.set_ylim(min(-0.4 * abs(best), best - 0.5), best + 0.08)
    for axes in (left, right):
        axes.set_xlim(0, latest)
        axes.set_xlabel("mean decision time, ticks")
        axes.grid(alpha=0.25)
        axes.spines[["top", "right"]].set_visible(False)
    left.legend(frameon=False, loc="upper left")
    canvas.suptitle(
        f"{result.plan.env_id.removeprefix('hybrid_env:')}: {result.world.hypotheses} hypotheses, "
        f"R = {result.world.measurement_variance} m²; filled: threshold chosen on other episodes"
    )
    with whole_file(path) as part:
        canvas.savefig(part, dpi=120)


def _band(entries: Sequence["Entry"], row: int) -> NDArray[np.float64]:
    """(2, thresholds) bounds of a figure: over training seeds, or over episodes where there is one."""
    if len(entries) > 1:
        values = np.array([entry.curve.means[row] for entry in entries])
        return np.array([values.min(0), values.max(0)])
    episodes = entries[0].curve.episodes[:, row]
    return np.array([interval(values) for values in episodes.T]).T
