"""Tables of scores for the terminal: figures with their intervals, the same for every task."""

from collections.abc import Mapping, Sequence

import numpy as np
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from agents.commands.comparison import Comparison
from agents.evaluation.cells import bounds_cell, estimate_cell, filled_table
from agents.evaluation.task import Metric, Task
from baselines.rules.fixed_time import NO_EARLY_DECISION
from baselines.scoring.estimates import Estimate
from baselines.scoring.scores import Scores

HALF_WIDTH = "± half width of the 95 % confidence interval."


def metric_cell(metric: Metric, estimate: Estimate) -> str:
    """Return a metric as a cell, with words for a value that is not reached."""
    undefined = "not\nreached" if np.isinf(estimate.value) else "-"
    return estimate_cell(estimate, metric.scale, metric.digits, undefined)


def scores_table(
    task: Task,
    rows: Sequence[tuple[Scores, Mapping[str, Estimate], Estimate | None]],
    title: str,
    notes: str = "",
    to: str = "",
) -> Table:
    """Return a table of deciders: scores of one threshold, metrics by name, difference of the
    goal to decider `to`.

    The difference is None for this one. The notes stand before the explanation of the metrics, each
    line with its end.
    """
    compared = any(difference is not None for *_, difference in rows)
    if compared:
        notes += f"diff.: {task.goal} less that of {to} on the same episodes.\n"
    quantiles = "delay_quantiles" in rows[0][0].extra
    has_bank = any(scores.bank for scores, *_ in rows)
    heads = [
        "decider     ",
        *(["bank\nread"] * has_bank),
        *(metric.head for metric in task.metrics),
    ]
    heads += ["delay\n50,90%"] * quantiles + [f"{task.goal}\ndiff."] * compared
    lines = []
    for scores, figures, difference in rows:
        cells = [metric_cell(metric, figures[metric.name]) for metric in task.metrics]
        if quantiles:
            ticks = scores.extra["delay_quantiles"][0]
            cells.append("\n".join(f"{one:.0f}" if np.isfinite(one) else "-" for one in ticks))
        if compared:
            goal = next(metric for metric in task.metrics if metric.name == task.goal)
            cells.append(
                "" if difference is None else estimate_cell(difference, 1.0, goal.digits, sign="+")
            )
        bank = [scores.bank.replace("_", "-\n")] * has_bank
        lines.append((decider_cell(scores), *bank, *cells))
    return filled_table(title, heads, lines, f"{notes}{HALF_WIDTH}\n{task.notes}".strip())


def decider_cell(scores: Scores) -> str:
    """Return the name of a decider, and below it its threshold, for the scores of a single one."""
    (threshold,) = scores.thresholds
    has_threshold = scores.symbol and threshold < NO_EARLY_DECISION
    shown = f"{scores.symbol} {threshold:g}" if has_threshold else "no threshold"
    return f"{escape(scores.name)}\n[bright_black]{shown}[/]"


def chosen_table(result: Comparison) -> Table:
    """Return the metrics of each decider at its selected threshold."""
    plan, task = result.plan, result.plan.task
    criterion = "the best reward" if plan.accuracy is None else f"{plan.accuracy:.1%} accuracy"
    rows = []
    for entry in result.entries:
        figures = {metric.name: result.figure(entry, metric.name) for metric in task.metrics}
        rows.append((entry.scores.at(entry.chosen), figures, result.to_best_rule(entry)))
    title = f"{task.title}: {task.size(plan.episodes)}, common to all"
    notes = f"Thresholds for {criterion}, selected on other episodes.\n"
    return scores_table(task, rows, title, notes, result.best_rule.name)


def levels_table(result: Comparison) -> Table:
    """Return figures of whole operating curves, and paired figures of each decider and the
    reference.
    """
    task, (reference, *others) = result.plan.task, result.entries
    word = {
        "diff.": f"diff.: less that of {reference.name}",
        "ratio": f"ratio: to that of {reference.name}",
    }
    found = [result.against(entry) for entry in others]
    pairs = list(dict.fromkeys((key, name) for one in found for key in one for name in one[key]))
    heads = ["decider", *(metric.head for metric in result.levels.values())]
    heads += [f"{name.replace('_', ' ')}\n{task.paired}" for _, name in pairs]
    lines = []
    for entry in result.entries:
        cells = [
            metric_cell(metric, result.level(entry, keys)) for keys, metric in result.levels.items()
        ]
        for key, name in pairs:
            paired = None if entry is reference else result.against(entry).get(key, {}).get(name)
            cells.append(
                "" if paired is None else bounds_cell(paired, 1 if name.startswith("ticks") else 3)
            )
        lines.append((escape(entry.name), *cells))
    notes = (
        f"Interpolated between thresholds. {HALF_WIDTH}\n{word[task.paired]} on the same episodes"
    )
    return filled_table(
        "On the operating curves",
        heads,
        lines,
        f"{notes}, with its 95 % interval.",
    )


def spread_lines(result: Comparison) -> list[str]:
    """Return a line for each agent that was trained several times: mean and range over training
    seeds.
    """
    lines, task = [], result.plan.task
    for group, entries in result.seed_groups.items():
        if len(entries) < 2:
            continue
        figures = [
            (metric, [result.figure(one, metric.name) for one in entries])
            for metric in task.metrics
        ]
        figures += [
            (metric, [result.level(one, keys) for one in entries])
            for keys, metric in result.levels.items()
        ]
        spread = []
        for metric, found in figures:
            values = metric.scale * np.array([one.value for one in found])
            mean, low, high = (
                f"{one:.{metric.digits}f}" for one in (values.mean(), values.min(), values.max())
            )
            spread.append(f"{' '.join(metric.head.split())} {mean} ({low} to {high})")
        lines.append(
            f"{group} over {len(entries)} training seeds, mean and range: " + ", ".join(spread)
        )
    return lines


def unreached_lines(result: Comparison) -> list[str]:
    """Return a line for each decider that does not reach the requested accuracy on the reported
    episodes.
    """
    level = result.plan.accuracy
    if level is None or not result.plan.curves:
        return []
    return [
        f"{entry.name} does not reach {level:.1%}: its most accurate threshold is shown"
        for entry in result.entries
        if entry.scores.curve(result.plan.task.statistic("accuracy")).max() < level
    ]


def confusion_table(scores: Scores, modes: Sequence[str]) -> Table:
    """Return the confusion matrix of a decider at a single threshold, see its title."""
    rows = [
        (mode, *map(str, row))
        for mode, row in zip(modes, scores.extra["confusion"][0], strict=True)
    ]
    title = Text.from_markup(decider_cell(scores)).plain.replace("\n", ", ")
    return filled_table(f"{title}: true mode in rows, decided mode in columns", ("", *modes), rows)
