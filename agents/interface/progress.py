"""Progress display of the commands: bars in a terminal, elsewhere lines with the same figures."""

import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    Task,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
)
from rich.text import Text

# Seconds before the first line outside a terminal, and between lines.
FIRST_LINE, NEXT_LINE = 0.5, 10.0


class TimeLeft(ProgressColumn):
    """The time left, which passes between two updates of a task: what its finished share predicts,
    less the time since this share was reached.
    """

    def __init__(self) -> None:
        super().__init__()
        # Begin and finished share of each task, and when it was first seen, in seconds after it.
        self._reached: dict[TaskID, tuple[Any, float]] = {}

    def words(self, task: Task) -> str:
        """Return the time left in words; "" where nothing predicts it."""
        share, now = task.percentage / 100.0, task.elapsed
        if not 0.0 < share < 1.0 or now is None:
            return ""
        state = task.start_time, share
        if self._reached.get(task.id, (None, 0.0))[0] != state:
            self._reached[task.id] = state, now
        left = self._reached[task.id][1] / share - now
        return f"{timedelta(seconds=round(left))} left" if left > 0.0 else ""

    def render(self, task: Task) -> Text:
        """See `ProgressColumn.render`."""
        return Text(self.words(task))


def progress_display(
    console: Console, transient: bool = False, clock: Callable[[], float] = time.monotonic
) -> Progress:
    """A live progress display; outside a terminal, a line on the standard error stream at once and
    every ten seconds.

    The description of a task says what runs now. Every task needs a `note` field with a short
    status text. A transient display is removed at the end.
    """
    if not console.is_terminal:
        return ProgressLines(disable=True, get_time=clock)
    return Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(bar_width=16),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeElapsedColumn(),
        TimeLeft(),
        TextColumn("{task.fields[note]}", markup=False),
        console=console,
        transient=transient,
        get_time=clock,
    )


def print_lines(console: Console, *lines: object) -> None:
    """Print lines as they are, however long they are."""
    for line in lines:
        console.print(str(line), markup=False, highlight=False, soft_wrap=True)


class ProgressLines(Progress):
    """Lines on the standard error stream, of all tasks that run."""

    def start(self) -> None:
        """Print lines from now on."""
        self._left, self._ended = TimeLeft(), threading.Event()
        threading.Thread(target=self.print_lines, args=[self._ended.wait], daemon=True).start()

    def stop(self) -> None:
        """Print no more lines."""
        self._ended.set()

    def print_lines(self, wait: Callable[[float], bool]) -> None:
        """Print a line after each wait, until a wait returns that the display has ended."""
        pause = FIRST_LINE
        while not wait(pause):
            pause = NEXT_LINE
            # The stream may be closed.
            with suppress(OSError, ValueError):
                print(self.line(), file=sys.stderr, flush=True)

    def line(self) -> str:
        """Return how far the tasks are, with the time since the begin of the first."""
        running = [task for task in self.tasks if not task.finished]
        texts = []
        for task in running:
            parts = [f"{task.percentage:.0f} %", self._left.words(task), task.fields["note"]]
            texts.append(f"{task.description}: {', '.join(filter(None, parts))}")
        elapsed = timedelta(seconds=round(running[0].elapsed or 0.0)) if running else ""
        return f"{elapsed} {'; '.join(texts) or 'Loading'}".strip()


@dataclass(frozen=True)
class Report:
    """Says how far a call is, in a file of one line: the call may run in another process."""

    path: Path

    def __call__(self, label: str, share: float, whole: float) -> None:
        """Say what runs now, which share of it is done, and which share of the whole call."""
        # On another machine the folder does not exist.
        with suppress(OSError):
            part = self.path.with_suffix(".part")
            part.write_text(f"{share} {whole} {label}", encoding="utf-8")
            # A reader never sees half of a line.
            part.replace(self.path)

    def read(self) -> tuple[str, float, float] | None:
        """Return what was said last; None if nothing was."""
        try:
            share, whole, label = self.path.read_text("utf-8").split(" ", 2)
            return label, float(share), float(whole)
        except (OSError, ValueError):
            return None


class Calls:
    """Shows calls by their reports: a bar for each one that runs, and one for all."""

    def __init__(self, progress: Progress, title: str, reports: Sequence[Report]):
        self.progress = progress
        self.reports = reports
        self.whole = progress.add_task(title, total=len(reports), note="")
        self._bars: dict[Report, TaskID] = {}
        self._labels: dict[Report, str] = {}

    def look(self) -> None:
        """Show what the reports say now."""
        completed = 0.0
        for report in self.reports:
            said = report.read()
            if said is None:
                continue
            label, share, whole = said
            completed += whole
            bar = self._bars.get(report)
            if bar is None:
                bar = self._bars[report] = self.progress.add_task(label, total=1.0, note="")
            elif label != self._labels[report]:
                # The time left is that of what runs now.
                self.progress.reset(bar, description=label)
            self._labels[report] = label
            self.progress.update(bar, completed=share, visible=whole < 1.0)
        self.progress.update(self.whole, completed=completed)


@contextmanager
def calls_shown(progress: Progress, title: str, count: int) -> Iterator[list[Report]]:
    """Show calls while they run, here or in other processes; yield the report of each."""
    with TemporaryDirectory() as folder:
        reports = [Report(Path(folder, str(number))) for number in range(count)]
        calls, ended = Calls(progress, title, reports), threading.Event()

        def watch() -> None:
            while not ended.wait(timeout=0.25):
                calls.look()

        thread = threading.Thread(target=watch, daemon=True)
        thread.start()
        try:
            yield reports
        finally:
            ended.set()
            thread.join()
            calls.look()
