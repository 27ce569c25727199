"""Operating curves: the figure of a comparison, for each task.

Deciders that differ only in their training seed are drawn as one curve, the mean of theirs, with
their range as the band. The other bands are 95 % bootstrap confidence intervals over episodes.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from agents.evaluation.announced import ACCURACY_LEVELS
from agents.evaluation.task import Selected, Task
from agents.evaluation.unknown import EQUAL_WRONG_CHANGES
from agents.figures.curves import Axis, Curve, Panel, curve_figure
from agents.figures.decider_colours import decider_styles
from baselines.rules.decider import ANNOUNCED
from baselines.scoring.scores import Statistic, mean
from baselines.scoring.statements import STATISTICS
from hybrid_env.checks import FloatArray, IntArray

# Deciders by name; those of one name differ only in their training seed.
Groups = Mapping[str, Sequence[Selected]]


def chosen(groups: Groups, statistic: Statistic) -> Iterator[float]:
    """Return a statistic of every decider at its selected threshold."""
    return (
        float(entry.scores.curve(statistic)[entry.chosen])
        for group in groups.values()
        for entry in group
    )


def means(group: Sequence[Selected], statistic: Statistic) -> FloatArray:
    """Return the mean of a statistic over training seeds at each threshold, (K,)."""
    return np.asarray(np.mean([entry.scores.curve(statistic) for entry in group], axis=0))


def curves(groups: Groups, x: Statistic, y: Statistic, above: tuple[float, float]) -> list[Curve]:
    """Return one curve for each name, of the points whose x is above the first number; y is at
    least the second.
    """
    styles = decider_styles(groups)
    drawn = []
    several_banks = len({group[0].scores.bank for group in groups.values()}) > 1
    for name, group in groups.items():
        places = means(group, x)
        shown = np.flatnonzero(places > above[0])
        if shown.size:
            points = zip(*(chosen({name: group}, statistic) for statistic in (x, y)), strict=True)
            selected = [
                (place, max(value, above[1])) for place, value in points if place > above[0]
            ]
            title = name if len(group) == 1 else f"{name}, {len(group)} seeds"
            title += f", {group[0].scores.bank.replace('_', '-')} bank" if several_banks else ""
            line, band = (
                np.maximum(of, above[1]) for of in (means(group, y)[shown], _band(group, y, shown))
            )
            drawn.append(
                Curve(title, styles[name], places[shown], line, bounds=band, selected=selected)
            )
    return drawn


def _band(group: Sequence[Selected], statistic: Statistic, shown: IntArray) -> FloatArray:
    """Return (2, K) bounds of a statistic: over training seeds, or over episodes for a single
    decider.
    """
    if len(group) > 1:
        values = np.array([entry.scores.curve(statistic) for entry in group])[:, shown]
        return np.array([values.min(0), values.max(0)])
    estimates = [group[0].scores.estimate(statistic, index) for index in shown.tolist()]
    return np.array([[estimate.low, estimate.high] for estimate in estimates]).T


def _announced_panels(task: Any, groups: Groups) -> list[Panel]:
    """Return accuracy and mean reward against mean decision time.

    The accuracy axis is logarithmic in the error rate, so that 98 % and 99 % are
    distinguishable. No error among n segments is drawn as half an error.
    """
    wrong_share = Statistic(("accuracy",), lambda accuracy: 1.0 - accuracy, share=True)
    shares = (0.5, 0.3, 0.2, 0.1, 0.05, 0.02, 0.01, 5e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4)
    first = next(iter(groups.values()))[0].scores
    least = 0.5 / (first.episodes * task.options.segments)
    times, wrong, rewards = (
        list(chosen(groups, statistic))
        for statistic in (mean("ticks"), wrong_share, mean("reward"))
    )
    best = max(rewards)
    worst = min(rewards)
    ticks = Axis(
        "mean decision time, ticks",
        (0.0, max([30.0, *(1.8 * time for time in times)])),
    )
    error = Axis(
        "accuracy, % of segments",
        (max(0.6, 1.1 * max(wrong)), min(0.8e-3, 0.8 * max(min(wrong), least))),
        {share: f"{100 * (1 - share):g}" for share in shares},
        log=True,
        levels=tuple(1.0 - level for level in ACCURACY_LEVELS),
    )
    reward = Axis(
        "mean reward per segment",
        (min(-0.4 * abs(best), best - 0.5, worst - 0.08), best + 0.08),
    )
    shown = curves(groups, mean("ticks"), wrong_share, (-np.inf, least))
    accuracy = "Accuracy against mean decision time"
    cost = f"Mean reward per segment, delay cost {task.options.delay_cost:g} per tick"
    return [
        Panel(accuracy, ticks, error, shown),
        Panel(
            cost,
            ticks,
            reward,
            curves(groups, mean("ticks"), mean("reward"), (-np.inf, -np.inf)),
        ),
    ]


def _unknown_panels(task: Any, groups: Groups) -> list[Panel]:
    """Return mean delay and mean reward against wrong changes per 1,000 ticks.

    Switches that are not detected count in the delay: a strict threshold, which detects only
    the easiest ones, would else seem quick. A dashed line marks the rate at which delays are
    compared.
    """
    wrong = mean("wrong_changes")
    rates = [EQUAL_WRONG_CHANGES, *(rate for rate in chosen(groups, wrong) if rate > 0.0)]
    low = min(rates) / 3.0
    high = max(rates) * 3.0
    places = [digit * power for power in (0.01, 0.1, 1.0, 10.0, 100.0) for digit in (1, 2, 5)]
    ticks = {rate: f"{rate:g}" for rate in places if low <= rate <= high}
    axis = Axis(
        "wrong changes per 1,000 ticks",
        (low, high),
        ticks,
        log=True,
        levels=(EQUAL_WRONG_CHANGES,),
    )
    reward = f"Mean reward, a wrong change costs {task.options.change_cost:g} ticks"
    parts = []
    every = [entry.scores for group in groups.values() for entry in group]
    x = np.concatenate([scores.curve(wrong) for scores in every])
    inside = (x >= min(rates) / 1.7) & (x <= high)
    for title, label, name in (
        ("Delay against wrong changes", "mean delay of a switch, ticks", "full_delay"),
        (reward, "mean reward of a tick", "reward"),
    ):
        shown = np.concatenate([scores.curve(STATISTICS[name]) for scores in every])[
            inside
        ].tolist()
        margin = 0.06 * (max(shown) - min(shown))
        limits = min(shown) - margin, max(shown) + margin
        lines = curves(groups, wrong, STATISTICS[name], (0.0, -np.inf))
        parts.append(Panel(title, axis, Axis(label, limits), lines))
    if task.several_radii:
        styles = decider_styles(groups)
        for k, title in enumerate(("Straight, left or right named", "Type and radius named")):
            lines = []
            for name, group in groups.items():
                shares = np.mean(
                    [entry.scores.extra["named_within"][entry.chosen, k] for entry in group],
                    axis=0,
                )
                lines.append(
                    Curve(name, styles[name], np.arange(shares.size), 100.0 * shares, size=0.0)
                )
            times = Axis("ticks after a switch", (0.0, float(shares.size)))
            parts.append(Panel(title, times, Axis("switches, %", (0.0, 100.0)), lines))
    return parts


def panels(task: Task, groups: Groups) -> list[Panel]:
    """Return the operating curves of deciders, the reference first."""
    return (_announced_panels if task.switches == ANNOUNCED else _unknown_panels)(task, groups)


def comparison_figure(task: Task, groups: Groups) -> Figure:
    """Return the figure of a comparison, see `panels`."""
    parts = panels(task, groups)
    options = task.options
    variances = " and ".join(f"{variance:g}" for variance in options.variances)
    title = f"{task.title}: {options.hypotheses} hypotheses, R = {variances} m²"
    note = "Filled markers: thresholds selected on other episodes."
    if task.switches != ANNOUNCED:
        title += f", segments of {options.law} ticks"
        note += " A switch that is not detected counts until the end of its segment."
    rows = [parts[k : k + 2] for k in range(0, len(parts), 2)]
    return curve_figure(rows, (13.0, 5.2 * len(rows)), title, note)
