"""Progress display of the commands."""

import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from datetime import timedelta
from typing import Any, TypeVar

from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    Task,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

T = TypeVar("T")


def progress_display(console: Console, transient: bool = False) -> Progress:
    """A live progress display; outside a terminal, occasional lines on the standard error stream.

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


def shown(
    console: Console,
    title: str,
    total: int,
    work: Callable[[Callable[[str], None]], T],
) -> T:
    """Return what `work` returns, which is given a function that shows a note when one of its
    parts is done.
    """
    with progress_display(console) as progress:
        bar = progress.add_task(title, total=total, note="")
        result = work(lambda note: progress.update(bar, advance=1, note=note))
        progress.update(bar, note="")
    return result


def train_shown(run: Any, progress: Progress, title: str, save_every: float = 10.0) -> None:
    """Train an `Algorithm` with a bar of its steps."""
    bar = progress.add_task(title, total=run.steps, note="")

    def show(now: Any) -> None:
        progress.update(bar, completed=min(now.steps, now.total), note=now.note)

    run.train(show, save_every)
    progress.update(bar, completed=run.steps)


class _ProgressLines(Progress):
    """Lines on the standard error stream. The longer the command takes, the rarer they are."""

    def start(self) -> None:
        self._ended = threading.Event()
        self._printer = threading.Thread(target=self._print_lines, daemon=True)
        self._printer.start()

    def stop(self) -> None:
        self._ended.set()
        self._printer.join()

    def _print_lines(self) -> None:
        began = time.monotonic()
        # Seconds from the first line on.
        silence = 10.0
        while not self._ended.wait(silence):
            current = [task for task in self.tasks if not task.finished]
            if current:
                # The stream is closed.
                with suppress(OSError, ValueError):
                    print(_line(current[-1]), file=sys.stderr, flush=True)
            silence = min(60.0, max(10.0, 0.2 * (time.monotonic() - began)))


def _line(task: Task) -> str:
    """Text of a task, such as "Training: 40 % after 0:00:12, about 0:00:18 left: reward +0.31"."""
    text = (
        f"{task.description}: {task.percentage:.0f} % after"
        f" {timedelta(seconds=round(task.elapsed or 0.0))}"
    )
    if task.time_remaining:
        text += f", about {timedelta(seconds=round(task.time_remaining))} left"
    return text + (f": {task.fields['note']}" if task.fields["note"] else "")
