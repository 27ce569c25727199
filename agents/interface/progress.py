"""Progress display of the commands."""

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn


def progress_display(console: Console, transient: bool = False) -> Progress:
    """A live progress display. Every task needs a `note` field with a short status text.

    Args:
        console: to print on.
        transient: remove the display at the end; outside a terminal there is none.
    """
    return Progress(
        TextColumn("{task.description:<12}"),
        BarColumn(bar_width=16),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[note]}", markup=False),  # names of deciders may contain brackets
        console=console,
        transient=transient,
        disable=transient and not console.is_terminal,
    )
