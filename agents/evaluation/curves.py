"""Operating curves: the figure of a comparison, for each task.

Deciders that differ only in their training seed are drawn as one curve, the mean of theirs, with
their range as the band. The other bands are 95 % bootstrap confidence intervals over episodes.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from agents.evaluation.report import Result
from agents.evaluation.task import Task
from agents.figures.curves import Curve, draw_levels, draw_panel, panel_figure
from agents.figures.decider_colours import decider_styles
from baselines.scoring.scores import Statistic, mean
from baselines.scoring.statements import STATISTICS

# Deciders by name; those of one name differ only in their training seed.
Groups = Mapping[str, Sequence[Result]]


def curves(
    task: Task,
    groups: Groups,
    x: Statistic,
    y: Statistic,
    least_x: float = -np.inf,
    least_y: float = -np.inf,
) -> list[Curve]:
    """Return one curve for each name, of the points whose x is above a number; y is drawn as at
    least another number. A bank that is not that of the environment is named.
    """
    styles = decider_styles(groups)
    drawn = []
    for name, group in groups.items():
        places = np.mean([entry.scores.curve(x) for entry in group], axis=0)
        shown = np.flatnonzero(places > least_x)
        if not shown.size:
            continue
        values = np.array([entry.scores.curve(y)[shown] for entry in group])
        scores = group[0].scores
        if len(group) > 1:
            band = np.array([values.min(0), values.max(0)])
        else:
            estimates = [scores.estimate(y, index) for index in shown.tolist()]
            band = np.array([[estimate.low, estimate.high] for estimate in estimates]).T
        points = np.array(
            [[entry.scores.curve(of)[entry.chosen] for of in (x, y)] for entry in group]
        )
        title = name if len(group) == 1 else f"{name}, {len(group)} seeds"
        if scores.bank and scores.bank != task.options.bank:
            title += f", {scores.bank.replace('_', '-')} bank"
        drawn.append(
            Curve(
                title,
                styles[name],
                places[shown],
                np.maximum(values.mean(0), least_y),
                bounds=np.maximum(band, least_y),
                selected=np.maximum(points[points[:, 0] > least_x], [-np.inf, least_y]),
            )
        )
    return drawn


def _draw_announced(task: Any, groups: Groups, panels: Sequence[Any], bound: float | None) -> None:
    """Draw mean reward and accuracy against mean decision time; the best rule and the bound on the
    reward are dashed lines.

    Shown is where deciders earn most. The accuracy axis is logarithmic in the error rate, so that
    98 % and 99 % are distinguishable. No error among n segments is drawn as half an error.
    """
    wrong_share = Statistic(("accuracy",), lambda accuracy: 1.0 - accuracy, share=True)
    shares = (0.5, 0.3, 0.2, 0.1, 0.05, 0.02, 0.01, 5e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4)
    first = next(iter(groups.values()))[0].scores
    least = 0.5 / (first.episodes * task.options.segments)
    errors = curves(task, groups, mean("ticks"), wrong_share, least_y=least)
    rewards = curves(task, groups, mean("ticks"), mean("reward"))
    earned = {curve.name: np.asarray(curve.selected)[:, 1].max() for curve in rewards}
    best = max(earned.values())
    # Others, which earn much less, are named in the note.
    near = {name: reward for name, reward in earned.items() if reward >= best - 0.2 * abs(best)}
    top = best if bound is None else max(best, bound)
    margin = 0.6 * (top - min(near.values())) + 0.02
    lowest = min(near.values()) - margin
    points: Any = [(a.x, a.y, b.y) for a, b in zip(rewards, errors, strict=True)]
    x, y, share = np.hstack(points)
    times, wrong = x[y >= lowest], share[y >= lowest]
    rules = [entry for group in groups.values() for entry in group if not entry.learned]
    levels = {}
    if rules:
        rule = max(rules, key=lambda entry: entry.selected)
        level = float(rule.scores.curve(mean("reward"))[rule.chosen])
        levels[level] = f"{rule.name} {level:.3f}"
    if bound is not None:
        levels[bound] = f"bound {bound:.3f}"
    below = [f"{name} {reward:.3f}" for name, reward in earned.items() if name not in near]
    ticks: dict[str, Any] = {
        "xlabel": "mean decision time, ticks",
        "xlim": (times.min() - 1.0, times.max() + 1.0),
    }
    draw_levels(panels[0], levels)
    draw_panel(
        panels[0],
        rewards,
        "\n".join(["not shown:", *below]) if below else "",
        title=f"Mean reward per segment, delay cost {task.options.delay_cost:g} per tick",
        ylabel="mean reward per segment",
        ylim=(lowest, top + margin),
        **ticks,
    )
    draw_panel(
        panels[1],
        errors,
        title="Accuracy",
        ylabel="accuracy, % of segments",
        yscale="log",
        yticks=shares,
        yticklabels=[f"{100 * (1 - share):g}" for share in shares],
        ylim=(min(1.2 * wrong.max(), 0.9), 0.7 * wrong.min()),
        **ticks,
    )


def _draw_unknown(task: Any, groups: Groups, panels: Sequence[Any]) -> None:
    """Draw mean delay and mean reward against wrong changes per 1,000 ticks.

    Switches that are not detected count in the delay: a strict threshold, which detects only
    the easiest ones, would else seem quick. A dashed line marks the rate at which delays are
    compared.
    """
    reward = f"Mean reward, a wrong change costs {task.options.change_cost:g} ticks"
    parts = (
        ("Delay against wrong changes", "mean delay of a switch, ticks", "full_delay"),
        (reward, "mean reward of a tick", "reward"),
    )
    for axes, (title, label, name) in zip(panels, parts, strict=True):
        drawn = curves(task, groups, mean("wrong_changes"), STATISTICS[name], least_x=0.0)
        chosen = (x for curve in drawn for x in np.asarray(curve.selected)[:, 0])
        rates = [task.equal_wrong_changes, *chosen]
        low, high = min(rates) / 3.0, max(rates) * 3.0
        places = [digit * power for power in (0.01, 0.1, 1.0, 10.0, 100.0) for digit in (1, 2, 5)]
        ticks = [rate for rate in places if low <= rate <= high]
        axes.axvline(task.equal_wrong_changes, color="0.6", linewidth=0.8, linestyle="--", zorder=0)
        shown = [
            y
            for curve in drawn
            for x, y in zip(np.asarray(curve.x), np.asarray(curve.y), strict=True)
            if min(rates) / 1.7 <= x <= high
        ]
        limits: dict[str, Any] = {}
        if shown:
            margin = 0.06 * (max(shown) - min(shown))
            limits["ylim"] = min(shown) - margin, max(shown) + margin
        draw_panel(
            axes,
            drawn,
            title=title,
            xlabel="wrong changes per 1,000 ticks",
            ylabel=label,
            xscale="log",
            xticks=ticks,
            xticklabels=[f"{rate:g}" for rate in ticks],
            xlim=(low, high),
            **limits,
        )


def comparison_figure(task: Task, groups: Groups, bound: float | None = None) -> Figure:
    """Return the operating curves of deciders, the reference first. bound: on the mean reward."""
    options = task.options
    variances = " and ".join(f"{variance:g}" for variance in options.variances)
    title = f"{task.title}: {options.hypotheses} hypotheses, R = {variances} m²"
    note = "Filled markers: thresholds selected on other episodes."
    if not task.waits:
        title += f", segments of {options.law} ticks"
        note += " A switch that is not detected counts until the end of its segment."
    canvas, panels = panel_figure(2, 7.6, title, note)
    if task.waits:
        _draw_announced(task, groups, panels, bound)
    else:
        _draw_unknown(task, groups, panels)
    return canvas
