"""Tables and summary lines of a comparison for the terminal."""

import numpy as np
from rich import box
from rich.markup import escape
from rich.table import Table

from agents.comparison.study import ACCURACY_LEVELS, Comparison, Entry
from agents.evaluation.cells import estimate_cell, signed
from agents.evaluation.deciders import NO_EARLY_DECISION
from agents.evaluation.operating_curve import ACCURACY, Estimate
from baselines.rules.posterior_paths import MIN_COUNT


def comparison_table(result: Comparison) -> Table:
    """Figures of each decider, with the half width of their 95 % confidence intervals."""
    first = result.entries[0]
    segments = first.curve.decisions[0].correct.size
    level = result.plan.accuracy
    criterion = "for the best reward" if level is None else f"for {level:.1%} accuracy"
    caption = (
        f"Thresholds {criterion}, selected on other episodes.\n± half width of the 95 % confidence interval."
    )
    if result.plan.curves:
        time = f"{result.reference_ticks:.1f} ticks"
        caption += f"\n{time}: mean time of {escape(first.name)} at its default threshold."
    title = f"{result.plan.env_id.removeprefix('hybrid_env:')}: {segments:,} common segments"
    table = Table(
        title=title,
        min_width=len(title),
        caption=caption,
        box=box.SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
    )
    heads = ["decider", "accuracy\n%", "mean\nticks", "mean\nreward", "RMSE\nm"]
    if result.plan.curves:
        heads += [f"error, %\nat {result.reference_ticks:.1f}"]
        heads += [f"ticks at\n{level:.0%}" for level in ACCURACY_LEVELS]
    table.add_column(heads[0], overflow="fold")  # long names are wrapped, numbers are not
    for head in heads[1:]:
        table.add_column(head, justify="right", no_wrap=True)
    for entry in result.entries:
        family = entry.curve.family
        threshold = family.thresholds[entry.chosen]
        shown = f"{family.symbol} {threshold:g}" if threshold < NO_EARLY_DECISION else "no threshold"
        table.add_row(
            f"{escape(entry.name)}\n[bright_black]{shown}[/]",
            _cell(entry.accuracy, 100, 1), _cell(entry.ticks, 1, 1), _cell(entry.reward, 1, 3),
            _cell(entry.rmse, 1, 3), *_curve_cells(result, entry),
        )  # fmt: skip
    return table


def _curve_cells(result: Comparison, entry: Entry) -> list[str]:
    if not result.plan.curves:
        return []
    ticks = [_cell(entry.ticks_at[level], 1, 1) for level in ACCURACY_LEVELS]
    return [_cell(entry.error_at_reference_ticks, 100, 2), *ticks]


def unreached_accuracy_lines(result: Comparison) -> list[str]:
    """A line for each decider that does not reach the requested accuracy on the reported episodes."""
    level = result.plan.accuracy
    return [
        f"{entry.name} does not reach {level:.1%}: its most accurate threshold is shown"
        for entry in result.entries
        if level is not None and result.plan.curves and entry.curve.means[ACCURACY].max() < level
    ]


def error_table(result: Comparison) -> Table:
    """Error rate by previous decision: a wrong decision makes the anchor of the next segment inaccurate."""
    table = Table(title="Error rate by previous decision", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for head in ("decider", "after a correct\ndecision, %", "after a wrong\ndecision, %"):
        table.add_column(head, justify="left" if head == "decider" else "right")
    for entry in result.entries:
        cells = [f"{100 * share:.1f}" if np.isfinite(share) else "-" for share in entry.error_after]
        table.add_row(escape(entry.name), *cells)
    return table


def calibration_table(result: Comparison) -> Table:
    """Calibration of the bank's posterior after a number of ticks without a decision."""
    table = Table(
        title=f"Calibration of the {result.world.bank.replace('_', '-')} bank (no decisions)",
        caption=(
            f"Calibration error: mean posterior minus accuracy,\nin bins of at least {MIN_COUNT:,} segments."
        ),
        box=box.SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
    )
    for head in ("ticks", "accuracy\n%", "mean\nposterior, %", "largest calibration\nerror, %"):
        table.add_column(head, justify="right")
    for row in result.calibration_rows():
        table.add_row(
            f"{row['ticks']:g}", f"{100 * row['right']:.1f}", f"{100 * row['stated']:.1f}",
            f"{100 * row['worst']:+.1f}" if np.isfinite(row["worst"]) else "-",
        )  # fmt: skip
    return table


def summary_lines(result: Comparison) -> list[str]:
    """Differences of every decider to the reference on the same episodes, and spread over training seeds."""
    reference = result.entries[0]
    lines = []
    for entry in result.entries[1:]:
        parts = []
        difference = result.differences(entry)
        parts.append(f"reward {signed(difference['reward'], 3)} per segment")
        if "ticks_at_98" in difference:
            parts.append(f"{signed(difference['ticks_at_98'], 1)} ticks at 98 % accuracy")
        lines.append(f"{entry.name} compared with {reference.name}: " + ", ".join(parts))
    for group, trained in result.seed_groups().items():
        if len(trained) < 2:
            continue
        spread = []
        figures = [("reward", 3, [entry.reward.value for entry in trained])]
        if result.plan.curves:
            for level in ACCURACY_LEVELS:
                ticks = [entry.ticks_at[level].value for entry in trained]
                figures.append((f"ticks at {level:.0%}", 1, ticks))
            errors = [100 * entry.error_at_reference_ticks.value for entry in trained]
            figures.append((f"error rate at {result.reference_ticks:.1f} ticks, %", 2, errors))
        for name, digits, values in figures:
            low, mean, high = np.min(values), np.mean(values), np.max(values)
            spread.append(f"{name} {mean:.{digits}f} ({low:.{digits}f} to {high:.{digits}f})")
        lines.append(f"{group} over {len(trained)} training seeds, mean and range: " + ", ".join(spread))
    return lines


def _cell(estimate: Estimate, scale: float, digits: int) -> str:
    return estimate_cell(estimate, scale, digits, "not\nreached")
