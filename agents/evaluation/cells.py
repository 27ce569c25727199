"""Tables for the terminal and in Markdown; estimates with their intervals as cells and words of lines."""

from collections.abc import Iterable, Sequence

import numpy as np
from rich import box
from rich.markup import escape
from rich.table import Table

from baselines.scoring.estimates import Estimate


def new_table(title: str, caption: str = "") -> Table:
    """Return an empty table."""
    return Table(
        title=escape(title), min_width=len(title), caption=escape(caption) or None, caption_justify="left",
        box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0),
    )  # fmt: skip


def filled_table(
    title: str, heads: Sequence[str], rows: Iterable[Sequence[str]], caption: str = "", texts: int = 1
) -> Table:
    """Return a table whose first columns, `texts` of them, are of text; an empty row draws a line."""
    table = new_table(title, caption)
    if len(heads) > 7:  # fit into 80 columns
        table.padding = (0, 0, 0, 0)
    for column, head in enumerate(heads):
        if column < texts:  # long names are wrapped, numbers are not
            table.add_column(head, overflow="fold")
        else:
            table.add_column(head, justify="right", no_wrap=True)
    for row in rows:
        table.add_row(*row) if row else table.add_section()
    return table


def markdown_table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table in Markdown."""
    lines = (" | ".join(row) for row in rows)
    return (
        "\n".join(["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads), *(f"| {line} |" for line in lines)])
        + "\n"
    )


def estimate_cell(estimate: Estimate, scale: float, digits: int, undefined: str = "-", sign: str = "") -> str:
    """Return the value of an estimate, times `scale`, and below it the half width of its confidence interval if it has
    one.

    `undefined` stands for a value that is not finite; the sign "+" shows that of the value.
    """
    if not np.isfinite(estimate.value):
        return undefined
    value = f"{scale * estimate.value:{sign}.{digits}f}"
    if np.isnan(estimate.high):
        return value
    if not np.isfinite(estimate.high):
        return f"{value}\n[bright_black]> {scale * estimate.low:.{digits}f}[/]"
    return f"{value}\n[bright_black]±{scale * (estimate.high - estimate.low) / 2:.{digits}f}[/]"


def bounds_cell(estimate: Estimate, digits: int, scale: float = 1.0) -> str:
    """Return the value of an estimate, and below it the bounds of its confidence interval."""
    if not np.isfinite(estimate.value):
        return "-"
    value, low, high = (f"{scale * one:.{digits}f}" for one in vars(estimate).values())
    return f"{value}\n[bright_black]{low} to {high}[/]"


def signed(estimate: Estimate, digits: int) -> str:
    """Return the value of a difference with its confidence interval, all with their signs."""
    return f"{estimate.value:+.{digits}f} [{estimate.low:+.{digits}f}, {estimate.high:+.{digits}f}]"
