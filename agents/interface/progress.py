"""Progress display of the commands: bars in a terminal, elsewhere lines with the same figures."""

import functools
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from datetime import timedelta
from pathlib import Path
from tempfile import TemporaryDirectory

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn


def progress_display(
    console: Console, transient: bool = False, clock: Callable[[], float] = time.monotonic
) -> Progress:
    """A live progress display; outside a terminal, a line on the standard error stream at once and
    every ten seconds.

    The description of a task says what runs now. Every task needs a `note` field with a short
    status text. A transient display is removed at the end.
    """
    # Seconds whose updates predict the time left: a task may have few.
    period = 3600.0
    if not console.is_terminal:
        return ProgressLines(disable=True, get_time=clock, speed_estimate_period=period)
    return Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(bar_width=16),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[note]}", markup=False),
        console=console,
        transient=transient,
        get_time=clock,
        speed_estimate_period=period,
    )


def print_lines(console: Console, *lines: object) -> None:
    """Print lines as they are, however long they are."""
    for line in lines:
        console.print(str(line), markup=False, highlight=False, soft_wrap=True)


class ProgressLines(Progress):
    """Lines on the standard error stream, of all tasks that run."""

    def start(self) -> None:
        """Print lines from now on."""
        self._ended = threading.Event()
        threading.Thread(target=self.print_lines, args=[self._ended.wait], daemon=True).start()

    def stop(self) -> None:
        """Print no more lines."""
        self._ended.set()

    def print_lines(self, wait: Callable[[float], bool]) -> None:
        """Print a line after each wait, until a wait returns that the display has ended."""
        # Seconds before the first line, and between lines.
        pause = 0.5
        while not wait(pause):
            pause = 10.0
            # The stream may be closed.
            with suppress(OSError, ValueError):
                print(self.line(), file=sys.stderr, flush=True)

    def line(self) -> str:
        """Return how far the tasks are, with the time since the begin of the first."""
        running = [task for task in self.tasks if not task.finished]
        texts = []
        for task in running:
            left = f"{timedelta(seconds=task.time_remaining)} left" if task.time_remaining else ""
            parts = [f"{task.percentage:.0f} %", left, task.fields["note"]]
            texts.append(f"{task.description}: {', '.join(filter(None, parts))}")
        elapsed = timedelta(seconds=round(running[0].elapsed or 0.0)) if running else ""
        return f"{elapsed} {'; '.join(texts) or 'Loading'}".strip()


def write_progress(path: Path, label: str, share: float) -> None:
    """Say what a call does now, and which share of it is done, in a file of one line: the call may
    run in another process.
    """
    # On another machine the folder does not exist.
    with suppress(OSError):
        part = path.with_suffix(".part")
        part.write_text(f"{share} {label}", encoding="utf-8")
        # A reader never sees half of a line.
        part.replace(path)


def read_progress(path: Path) -> tuple[str, float]:
    """Return what was said last; nothing is done before it."""
    try:
        share, label = path.read_text("utf-8").split(" ", 1)
        return label, float(share)
    except (OSError, ValueError):
        return "", 0.0


@contextmanager
def calls_shown(
    progress: Progress, title: str, count: int
) -> Iterator[list[Callable[[str, float], None]]]:
    """Show calls while they run, here or in other processes; yield for each the function that says
    what it does now, and which share of it is done.
    """
    bar = progress.add_task(title, total=count, note="")
    with TemporaryDirectory() as folder:
        paths = [Path(folder, str(number)) for number in range(count)]
        ended = threading.Event()

        def look() -> None:
            labels, shares = zip(*map(read_progress, paths), strict=True)
            progress.update(bar, completed=sum(shares), note="; ".join(filter(None, labels)))

        def watch() -> None:
            while not ended.wait(timeout=0.25):
                look()

        thread = threading.Thread(target=watch, daemon=True)
        thread.start()
        try:
            yield [functools.partial(write_progress, path) for path in paths]
        finally:
            ended.set()
            thread.join()
            look()
