"""Tables for the terminal, and estimates with their intervals as cells."""

from collections.abc import Iterable, Sequence

import numpy as np
from rich import box
from rich.markup import escape
from rich.table import Table

from baselines.scoring.estimates import Estimate


def counted(number: int, word: str) -> str:
    """Return a number with a word in singular or plural."""
    return f"{number:,} {word}{'s' * (number != 1)}"


def filled_table(
    title: str,
    heads: Sequence[str],
    rows: Iterable[Sequence[str]],
    caption: str = "",
    texts: int = 1,
) -> Table:
    """Return a table whose first columns, `texts` of them, are of text; an empty row draws a
    line.
    """
    table = Table(
        title=escape(title),
        min_width=len(title),
        caption=escape(caption) or None,
        caption_justify="left",
        # Fits into 80 columns.
        box=box.SIMPLE_HEAD,
        padding=(0, int(len(heads) <= 7), 0, 0),
    )
    # Long names are wrapped, numbers are not.
    for column, head in enumerate(heads):
        words = column < texts
        table.add_column(
            head, "", justify="left" if words else "right", overflow="fold", no_wrap=not words
        )
    for row in rows:
        table.add_row(*row) if row else table.add_section()
    return table


def estimate_cell(estimate: Estimate, scale: float, digits: int, sign: str = "") -> str:
    """Return the value of an estimate, times `scale`, and below it the half width of its
    interval if it has one; words for a value that is not reached.
    """
    if not np.isfinite(estimate.value):
        return "not\nreached" if np.isinf(estimate.value) else "-"
    value = f"{scale * estimate.value:{sign}.{digits}f}"
    if np.isnan(estimate.high):
        return value
    if not np.isfinite(estimate.high):
        return f"{value}\n[bright_black]> {scale * estimate.low:.{digits}f}[/]"
    return f"{value}\n[bright_black]±{scale * (estimate.high - estimate.low) / 2:.{digits}f}[/]"
