"""Tables of scores for the terminal: figures with their intervals, the same for every task."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from agents.commands.comparison import Comparison
from agents.evaluation.cells import bounds_cell, estimate_cell, filled_table
from agents.evaluation.task import Metric, Task
from baselines.rules.decider import ANNOUNCED
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
            cells.append("\n".join(f"{tick:.0f}" if np.isfinite(tick) else "-" for tick in ticks))
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
    rows = [
        (entry.scores.at(entry.chosen), result.figures(entry), result.to_best_rule(entry))
        for entry in result.entries
    ]
    title = f"{task.title}: {task.size(plan.episodes)}, common to all"
    notes = f"Thresholds for {criterion}, selected on other episodes.\n"
    return scores_table(task, rows, title, notes, result.best_rule.name)


def levels_table(result: Comparison) -> Table:
    """Return figures of whole operating curves, and paired figures of each decider and the
    reference.
    """
    is_difference = result.plan.task.switches == ANNOUNCED
    paired, explained = ("diff.", "less") if is_difference else ("ratio", "to")
    names = list(dict.fromkeys(name for entry in result.entries for name in result.against(entry)))
    heads = ["decider", *(metric.head for metric in result.levels.values())]
    heads += [f"{name.replace('_', ' ')}\n{paired}" for name in names]
    lines = []
    for entry in result.entries:
        against = result.against(entry)
        values = zip(result.levels.values(), result.at_levels(entry).values(), strict=True)
        cells = [metric_cell(metric, value) for metric, value in values]
        cells += [
            bounds_cell(against[name], 1 if name.startswith("ticks") else 3)
            if name in against
            else ""
            for name in names
        ]
        lines.append((escape(entry.name), *cells))
    notes = (
        f"Interpolated between thresholds. {HALF_WIDTH}\n{paired}: {explained} that of"
        f" {result.entries[0].name} on the same episodes"
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
            (metric, [result.figures(entry)[metric.name] for entry in entries])
            for metric in task.metrics
        ]
        figures += [
            (metric, [result.at_levels(entry)[keys] for entry in entries])
            for keys, metric in result.levels.items()
        ]
        spread = []
        for metric, estimates in figures:
            values = metric.scale * np.array([estimate.value for estimate in estimates])
            mean, low, high = (
                f"{value:.{metric.digits}f}"
                for value in (values.mean(), values.min(), values.max())
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


def further_tables(result: Comparison, remarks: Mapping[str, Any]) -> list[Table]:
    """Return tables of the other figures of the task, and of the calibration of its bank."""
    task = result.plan.task
    tables = []
    if task.further:
        rows = [
            (
                escape(entry.name),
                *(
                    metric_cell(metric, entry.scores.estimate(metric.statistic, entry.chosen))
                    for metric in task.further
                ),
            )
            for entry in result.entries
        ]
        what = "Error rate by previous decision"
        title = what if task.switches == ANNOUNCED else "Type and radius after a switch"
        tables.append(
            filled_table(title, ("decider", *(metric.head for metric in task.further)), rows)
        )
    if "bank" in remarks:
        tables.append(calibration_table(remarks["bank"], task.options.bank))
    return tables


def calibration_table(rows: Sequence[Mapping[str, Any]], bank: str) -> Table:
    """Return a table of `calibration_rows` of a bank."""
    cells = []
    for row in rows:
        worst = "-" if row["worst"] is None else f"{100 * row['worst']:+.1f}"
        cells.append(
            (f"{row['ticks']:g}", f"{100 * row['right']:.1f}", f"{100 * row['stated']:.1f}", worst)
        )
    return filled_table(
        f"Calibration of the {bank.replace('_', '-')} bank (no decisions)",
        ("ticks", "accuracy\n%", "mean\nposterior, %", "largest calibration\nerror, %"),
        cells,
        "Calibration error: mean posterior minus accuracy,\nin bins of at least 1,000 segments.",
        0,
    )
