"""Tables of a comparison of deciders for unknown switch moments."""

from rich import box
from rich.markup import escape
from rich.table import Table

from agents.comparison.statement_study import EQUAL_WRONG_CHANGES, StatementComparison
from agents.evaluation.cells import estimate_cell, interval
from agents.evaluation.statement_table import statement_table


def chosen_table(result: StatementComparison) -> Table:
    """Figures of each decider at its selected threshold."""
    plan = result.plan
    title = f"{plan.env_id.removeprefix('hybrid_env:')}: {plan.tracks:,} common tracks"
    return statement_table(
        [entry.figures for entry in result.entries],
        f"{title} of {result.world.ticks:,} ticks",
        "Thresholds for the best reward, selected on other tracks.\n",
        result.differences,
        result.best_rule.name,
    )


def equal_table(result: StatementComparison) -> Table:
    """Delays of each decider at the same rate of wrong changes, and their ratio to those of the reference."""
    reference = result.entries[0]
    table = Table(
        title=f"At {EQUAL_WRONG_CHANGES:g} wrong changes per 1,000 ticks",
        caption=(
            "Interpolated on the operating curves.\n"
            f"ratio: to {escape(reference.name)} on the same tracks, with its 95 % interval."
        ),
        caption_justify="left",
        box=box.SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
    )
    table.add_column("decider", overflow="fold")
    for head in ("delay,\nall", "ratio", "delay\nof detected", "ratio", "missed\n%"):
        table.add_column(head, justify="right", no_wrap=True)
    for entry, ratios in zip(result.entries, result.ratios, strict=True):
        cells = []
        for name in ("full_delay", "delay"):
            cells.append(estimate_cell(entry.equal[name], 1, 1, "not\nreached"))
            cells.append("1" if entry is reference else interval(ratios[name], 3, "-"))
        cells.append(estimate_cell(entry.equal["missed"], 100, 1, "-"))
        table.add_row(escape(entry.name), *cells)
    return table
