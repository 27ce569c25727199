"""A comparison for the terminal: tables, and each decider against the reference in words."""

import numpy as np
from rich import box
from rich.table import Table

from agents.comparison.study import LEVELS, Comparison, Entry
from agents.evaluation.operating_curve import ACCURACY, Figure


def comparison_table(result: Comparison) -> Table:
    """For the terminal: each figure above the half width of its 95 % interval."""
    first = result.entries[0]
    segments = first.curve.decisions[0].correct.size
    wanted = result.plan.accuracy
    way = "Best-reward thresholds" if wanted is None else f"Thresholds for {wanted:.1%} accuracy"
    title = f"{result.plan.env_id.removeprefix('hybrid_env:')}: {segments:,} segments, the same for all"
    table = Table(
        title=title,
        min_width=len(title),
        caption=(
            f"{way} from other episodes; ± half of the 95 % interval.\n"
            f"{result.equal_time:.1f} ticks: {first.name} at its default threshold."
            if result.plan.curves
            else f"{way} from other episodes; ± half of the 95 % interval."
        ),
        box=box.SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
    )
    heads = ["decider", "accuracy\n%", "mean\nticks", "reward a\nsegment", "RMSE\nm"]
    if result.plan.curves:
        heads += [f"error at\n{result.equal_time:.1f} t, %"]
        heads += [f"{level:.0%}\nat tick" for level in LEVELS]
    table.add_column(heads[0], overflow="fold")  # long names give way, figures do not
    for head in heads[1:]:
        table.add_column(head, justify="right", no_wrap=True)
    for entry in result.entries:
        family = entry.curve.family
        table.add_row(
            f"{entry.name}\n[bright_black]{family.symbol} {family.thresholds[entry.chosen]:g}[/]",
            _cell(entry.accuracy, 100, 1), _cell(entry.ticks, 1, 1), _cell(entry.reward, 1, 3),
            _cell(entry.rmse, 1, 3), *_curve_cells(result, entry),
        )  # fmt: skip
    return table


def _curve_cells(result: Comparison, entry: Entry) -> list[str]:
    if not result.plan.curves:
        return []
    times = [_cell(entry.time_at[level], 1, 1) for level in LEVELS]
    return [_cell(entry.equal_time_error, 100, 2), *times]


def missed_accuracy(result: Comparison) -> list[str]:
    """A line for each decider that no threshold took to the wanted accuracy on the reported episodes."""
    wanted = result.plan.accuracy
    return [
        f"{entry.name} does not reach {wanted:.1%}: its most accurate threshold is shown"
        for entry in result.entries
        if wanted is not None and result.plan.curves and entry.curve.means[ACCURACY].max() < wanted
    ]


def error_table(result: Comparison) -> Table:
    """How an error makes the next one likelier, by a spoiled anchor."""
    table = Table(title="Wrong decisions, %", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for head in ("decider", "after a right one", "after a wrong one"):
        table.add_column(head, justify="left" if head == "decider" else "right")
    for entry in result.entries:
        cells = [f"{100 * share:.1f}" if np.isfinite(share) else "-" for share in entry.error_after]
        table.add_row(entry.name, *cells)
    return table


def bank_table(result: Comparison) -> Table:
    """What the bank says after some ticks, if no one decides before."""
    table = Table(
        title=f"The {result.world.bank.replace('_', '-')} bank while all wait",
        caption="Worst: of bins of the stated with 1,000 segments or more.",
        box=box.SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
    )
    for head in ("after ticks", "likeliest is right, %", "it says, %", "stated less actual, worst, %"):
        table.add_column(head, justify="right")
    for row in result.bank_rows():
        table.add_row(
            f"{row['ticks']:g}", f"{100 * row['right']:.1f}", f"{100 * row['stated']:.1f}",
            f"{100 * row['worst']:+.1f}" if np.isfinite(row["worst"]) else "-",
        )  # fmt: skip
    return table


def headlines(result: Comparison) -> list[str]:
    """Every decider against the reference, paired on the same episodes."""
    reference = result.entries[0]
    lines = []
    for entry in result.entries[1:]:
        parts = []
        gain = result.gains(entry)
        parts.append(f"reward {_signed(gain['reward'], 3)} a segment")
        if "ticks_at_98" in gain:
            parts.append(f"{_signed(gain['ticks_at_98'], 1)} ticks at 98 % accuracy")
        lines.append(f"{entry.name} against {reference.name}: " + ", ".join(parts))
    for kind, trained in result.by_kind().items():
        if len(trained) < 2:
            continue
        spread = []
        figures = [("reward", 3, [entry.reward.value for entry in trained])]
        if result.plan.curves:
            for level in LEVELS:
                times = [entry.time_at[level].value for entry in trained]
                figures.append((f"{level:.0%} at tick", 1, times))
            errors = [100 * entry.equal_time_error.value for entry in trained]
            figures.append((f"error at {result.equal_time:.1f} ticks, %", 2, errors))
        for name, digits, values in figures:
            low, mean, high = np.min(values), np.mean(values), np.max(values)
            spread.append(f"{name} {mean:.{digits}f} ({low:.{digits}f} to {high:.{digits}f})")
        lines.append(f"{kind} over {len(trained)} training seeds, mean and range: " + ", ".join(spread))
    return lines


def _cell(figure: Figure, scale: float, digits: int) -> str:
    if not np.isfinite(figure.value):
        return "not\nreached"
    value = f"{scale * figure.value:.{digits}f}"
    if not np.isfinite(figure.high):
        return f"{value}\n[bright_black]> {scale * figure.low:.{digits}f}[/]"
    return f"{value}\n[bright_black]±{scale * (figure.high - figure.low) / 2:.{digits}f}[/]"


def _signed(figure: Figure, digits: int) -> str:
    return f"{figure.value:+.{digits}f} [{figure.low:+.{digits}f}, {figure.high:+.{digits}f}]"
