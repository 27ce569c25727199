"""Progress display of the commands."""

import sys
import threading
from contextlib import suppress
from datetime import timedelta
from typing import Any

from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)


def progress_display(console: Console, transient: bool = False) -> Progress:
    """A live progress display; outside a terminal, a line on the standard error stream every half
    minute.

    Every task needs a `note` field with a short status text. A transient display is removed at the
    end.
    """
    if not console.is_terminal:
        return _ProgressLines(disable=True)
    return Progress(
        TextColumn("{task.description:<12}"),
        BarColumn(bar_width=16),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[note]}", markup=False),
        console=console,
        transient=transient,
    )


def print_lines(console: Console, *lines: object) -> None:
    """Print lines as they are, however long they are."""
    for line in lines:
        console.print(str(line), markup=False, highlight=False, soft_wrap=True)


def train_shown(run: Any, progress: Progress, title: str, save_every: float = 10.0) -> None:
    """Train an `Algorithm` with a bar of its steps."""
    bar = progress.add_task(title, total=run.steps, note="")

    def show(now: Any) -> None:
        progress.update(bar, completed=min(now.steps, now.total), note=now.note)

    run.train(show, save_every)
    progress.update(bar, completed=run.steps)


class _ProgressLines(Progress):
    """A line on the standard error stream every half minute."""

    def start(self) -> None:
        self._ended = threading.Event()
        threading.Thread(target=self._print_lines, daemon=True).start()

    def stop(self) -> None:
        self._ended.set()

    def _print_lines(self) -> None:
        while not self._ended.wait(30.0):
            current = [task for task in self.tasks if not task.finished]
            # The stream may be closed.
            with suppress(OSError, ValueError):
                for task in current[-1:]:
                    elapsed = timedelta(seconds=round(task.elapsed or 0.0))
                    words = f"{task.description}: {task.percentage:.0f} % after {elapsed}"
                    print(words, task.fields["note"], file=sys.stderr, flush=True)
