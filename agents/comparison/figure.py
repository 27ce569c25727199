"""Operating curves of a comparison."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure as Canvas
from matplotlib.transforms import ScaledTranslation
from numpy.typing import NDArray

from agents.comparison.study import ACCURACY_LEVELS, Comparison, Entry
from agents.evaluation.evaluate import confidence_interval, share_interval
from agents.evaluation.operating_curve import ACCURACY, REWARD, TICKS
from agents.interface.curve_labels import label_curves
from agents.interface.decider_colours import DeciderStyle, decider_styles
from agents.interface.output_files import atomic_file

ERROR_TICKS = (0.5, 0.3, 0.2, 0.1, 0.05, 0.02, 0.01, 5e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4)
DPI = 120

FloatArray = NDArray[np.float64]


def draw_operating_curves(result: Comparison, path: Path) -> None:
    """Write `operating_curves` as PNG."""
    canvas = operating_curves(result)
    with atomic_file(path) as part:
        canvas.savefig(part)


def operating_curves(result: Comparison) -> Canvas:
    """Accuracy and mean reward against mean decision time, one curve per decider.

    The accuracy axis is logarithmic in the error rate, so that 98 % and 99 % are distinguishable. Agents that
    differ only in their training seed are drawn as their mean, with their range as the band. The other bands
    are 95 % bootstrap confidence intervals over episodes. Filled markers are the thresholds selected on other
    episodes. An arrow marks where a curve leaves the axes. A hollow marker at the right edge means that
    the decider does not reach the accuracy level.
    """
    canvas = Canvas(figsize=(11.5, 5.2), layout="constrained", dpi=DPI)
    FigureCanvasAgg(canvas)
    left, right = canvas.subplots(1, 2)
    groups = result.seed_groups()
    styles = decider_styles(groups)
    errors, rewards = [], []
    for name, entries in groups.items():
        # no error among n segments is drawn as half an error
        least = 0.5 / entries[0].curve.decisions[0].correct.size
        bounds = np.maximum(1.0 - _band(entries, ACCURACY), least)
        selected = [entry.curve.means[:, entry.chosen] for entry in entries]
        means = np.mean([entry.curve.means for entry in entries], axis=0)
        label = name if len(entries) == 1 else f"{name}, {len(entries)} seeds"
        curve = np.maximum(1.0 - means[ACCURACY], least)
        points = [(point[TICKS], max(1.0 - point[ACCURACY], least)) for point in selected]
        errors.append((draw_curve(left, means[TICKS], curve, bounds, points, styles[name]), label))
        points = [(point[TICKS], point[REWARD]) for point in selected]
        bounds = _band(entries, REWARD)
        rewards.append((draw_curve(right, means[TICKS], means[REWARD], bounds, points, styles[name]), label))

    _set_limits(left, right, result, list(groups.values()))
    left.set_ylabel("accuracy, % of segments")
    left.set_title("Accuracy against mean decision time")
    right.set_ylabel("mean reward per segment")
    right.set_title(f"Mean reward per segment, delay cost {result.world.delay_cost:g} per tick")
    for axes in (left, right):
        axes.set_xlabel("mean decision time, ticks")
        axes.grid(alpha=0.25)
        axes.spines[["top", "right"]].set_visible(False)
    variances = " and ".join(f"{variance:g}" for variance in result.world.variances)
    canvas.suptitle(
        f"{result.plan.env_id.removeprefix('hybrid_env:')}: {result.world.hypotheses} hypotheses, "
        f"R = {variances} m²"
    )
    canvas.supxlabel(
        "Filled markers: thresholds selected on other episodes. "
        "Arrows: the curve continues outside the axes.",
        fontsize=9,
        color="0.3",
    )
    swept = {
        name: entries
        for name, entries in groups.items()
        if result.plan.curves or entries[0] is result.entries[0]
    }
    _mark_unreached_levels(left, swept, styles)
    for axes, curves in ((left, errors), (right, rewards)):
        for line, _ in curves:
            mark_edges(axes, line)
        label_curves(axes, curves)
    return canvas


def draw_curve(
    axes: Any,
    abscissas: FloatArray,
    values: FloatArray,
    bounds: FloatArray,
    selected: Sequence[tuple[float, float]],
    style: DeciderStyle,
) -> Any:
    """Draw the curve of a decider with hollow markers, and return its line.

    Args:
        axes: to draw in.
        abscissas, values: (K,) of each threshold.
        bounds: (2, K) of the band.
        selected: points with filled markers.
        style: of the decider.
    """
    axes.fill_between(abscissas, *bounds, color=style.colour, alpha=0.13, linewidth=0)
    (line,) = axes.plot(
        abscissas, values, color=style.colour, marker=style.marker, markersize=4.5, markerfacecolor="white",
        markeredgewidth=0.9, linewidth=1.4,
    )  # fmt: skip
    axes.plot(
        *np.reshape(selected, (-1, 2)).T, linestyle="none", color=style.colour, marker=style.marker,
        markersize=8, zorder=5,
    )  # fmt: skip
    return line


def _set_limits(left: Any, right: Any, result: Comparison, groups: Sequence[Sequence[Entry]]) -> None:
    """Limits that show the selected thresholds and the curves up to an accuracy of 99.8 %."""
    ends = [30.0]
    for entries in groups:
        means = np.mean([entry.curve.means for entry in entries], axis=0)
        ticks, accuracy = means[TICKS], means[ACCURACY]
        ends.append(float(np.interp(0.998, accuracy, ticks)) if accuracy.max() > 0.9 else float(ticks.max()))
        ends += [entry.ticks.value for entry in entries]
    best = max(entry.reward.value for entry in result.entries)
    worst = min(entry.reward.value for entry in result.entries)
    least = 0.5 / result.entries[0].curve.decisions[0].correct.size
    selected = [max(1.0 - entry.accuracy.value, least) for entry in result.entries]
    left.set_yscale("log")
    left.set_yticks(ERROR_TICKS, [f"{100 * (1 - error):g}" for error in ERROR_TICKS], minor=False)
    left.set_yticks([], minor=True)
    left.set_ylim(max(0.6, 1.1 * max(selected)), min(0.8e-3, 0.8 * min(selected)))
    right.set_ylim(min(-0.4 * abs(best), best - 0.5, worst - 0.08), best + 0.08)
    for axes in (left, right):
        axes.set_xlim(0, 1.05 * max(ends))


def _mark_unreached_levels(
    axes: Any, groups: Mapping[str, Sequence[Entry]], styles: Mapping[str, DeciderStyle]
) -> None:
    """Hollow markers at the right edge for the deciders that do not reach an accuracy level."""
    for level in ACCURACY_LEVELS:
        axes.axhline(1.0 - level, color="0.75", linewidth=0.8, linestyle="--", zorder=0)
        missing = [
            styles[name]
            for name, entries in groups.items()
            if np.mean([entry.curve.means[ACCURACY] for entry in entries], axis=0).max() < level
        ]
        if not missing:
            continue
        edge = axes.get_yaxis_transform()
        axes.annotate(
            f"{100 * level:g} % not reached", (1.0, 1.0 - level), (6, 3), xycoords=edge, fontsize=8,
            color="0.3", textcoords="offset points", va="bottom", annotation_clip=False,
        )  # fmt: skip
        for index, style in enumerate(missing):
            shift = ScaledTranslation((10 + 11 * index) / 72, -7 / 72, axes.figure.dpi_scale_trans)
            axes.plot(
                1.0, 1.0 - level, transform=edge + shift, marker=style.marker, markersize=6.5,
                color=style.colour, markerfacecolor="white", clip_on=False,
            )  # fmt: skip


def mark_edges(axes: Any, line: Any) -> None:
    """An arrow along a curve wherever it crosses an edge of the axes."""
    axes.figure.draw_without_rendering()  # fixes the layout
    box = axes.get_window_extent()
    points = axes.transData.transform(line.get_xydata())
    for start, end in pairwise(points):
        inside = [box.contains(*point) for point in (start, end)]
        if inside[0] != inside[1]:
            inner, outer = (start, end) if inside[0] else (end, start)
            edge = _edge_crossing(inner, outer, box)
            direction = (outer - inner) / np.hypot(*(outer - inner))
            ends = axes.transAxes.inverted().transform([edge, edge - 14.0 * direction])
            arrow = axes.annotate(
                "", ends[0], ends[1], xycoords="axes fraction", textcoords="axes fraction", zorder=6,
                arrowprops={
                    "arrowstyle": "-|>", "color": line.get_color(), "mutation_scale": 11, "linewidth": 1.4,
                    "shrinkA": 0, "shrinkB": 0,
                },
            )  # fmt: skip
            arrow.set_in_layout(False)


def _edge_crossing(inner: FloatArray, outer: FloatArray, box: Any) -> FloatArray:
    """Point at which a segment from a point inside a box to one outside leaves the box."""
    step = outer - inner
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = np.concatenate([(box.min - inner) / step, (box.max - inner) / step])
    share = min((share for share in shares if 0.0 <= share <= 1.0), default=1.0)
    return np.asarray(inner + share * step)


def _band(entries: Sequence[Entry], row: int) -> FloatArray:
    """(2, thresholds) bounds of a figure: over training seeds, or over episodes for a single agent."""
    if len(entries) > 1:
        values = np.array([entry.curve.means[row] for entry in entries])
        return np.array([values.min(0), values.max(0)])
    episodes = entries[0].curve.episodes[:, row]
    interval_of = share_interval if row == ACCURACY else confidence_interval
    return np.array([interval_of(values) for values in episodes.T]).T
