"""Work on many files: in parallel, with a progress display; a bad file does not stop the others."""

import functools
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import joblib
from rich.console import Console
from rich.table import Table

from agents.interface.parallel import Workers
from agents.interface.progress import progress_display
from hybrid_env.checks import ArgumentError, reject

PARALLEL_FILES = 8
"""With fewer files the start of processes takes longer than it saves."""


@dataclass(frozen=True)
class Report:
    """What is printed about a file.

    Attributes:
        lines: what was read, found and written.
        table: details, which are printed for a single file only.
        files: the files that were written, printed for a single file only.
    """

    lines: tuple[str, ...]
    table: Table | None = None
    files: tuple[Path, ...] = ()


Work = Callable[[Path, Path], Report]
"""Work on a file: its path and output folder. Raises ArgumentError. It can be pickled."""


def work_on_files(
    work: Work, paths: Sequence[Path], folders: Sequence[Path], jobs: int | None = None
) -> None:
    """Work on files and print a report for each, in their order.

    The results do not depend on the number of jobs.

    Args:
        work: work on one file.
        paths: the files.
        folders: their output folders.
        jobs: number of processes; None is one for each core if there are at least eight files.

    Raises:
        ArgumentError: a file could not be worked on. If there are several, each such file has its line on the
            standard error output and the error gives their number.
    """
    console = Console(emoji=False)
    if len(paths) == 1:
        with console.status("Tracking"):
            report = work(paths[0], folders[0])
        _print(console, report)
        return
    errors = Console(stderr=True, emoji=False)
    failed = 0
    with progress_display(console, transient=True) as progress:
        task = progress.add_task("Tracking", total=len(paths), note="")
        calls = {file: functools.partial(_attempt, work, *file) for file in zip(paths, folders, strict=True)}
        for _, result in Workers(_jobs(jobs, len(paths))).results(calls):
            if isinstance(result, Report):
                for line in result.lines:
                    progress.console.print(line, markup=False, highlight=False, soft_wrap=True)
            else:
                failed += 1
                errors.print(f"hybridtrack: {result}", markup=False, highlight=False, soft_wrap=True)
            progress.update(task, advance=1, note=f"{failed} failed" if failed else "")
    if failed:
        verb = "is" if failed == 1 else "are"
        raise ArgumentError(f"{failed:,} of {len(paths):,} files {verb} not tracked; the others are")


def check_free(folder: Path, overwrite: bool) -> None:
    """Check that the results of a file can be written to a folder, before any work.

    Raises:
        ArgumentError: the folder holds files and may not be overwritten, or it cannot be written to.
    """
    try:
        if folder.is_dir() and any(folder.iterdir()) and not overwrite:
            raise reject("out", str(folder), "a new or empty folder, or --overwrite")
        existing = folder
        while not existing.exists() and existing != existing.parent:
            existing = existing.parent
        writable = existing.is_dir() and os.access(existing, os.W_OK | os.X_OK)
    except (OSError, ValueError) as error:
        if isinstance(error, ArgumentError):
            raise
        writable = False
    if not writable:
        raise reject("out", str(folder), "a writable folder")


def _jobs(jobs: int | None, files: int) -> int:
    if jobs is None:
        jobs = joblib.cpu_count() if files >= PARALLEL_FILES else 1
    return min(jobs, files)


def _attempt(work: Work, path: Path, folder: Path) -> Report | str:
    try:
        return work(path, folder)
    except ArgumentError as error:
        return str(error)
    except OSError as error:
        return f"{path}: {error.strerror or error}"


def _print(console: Console, report: Report) -> None:
    for line in report.lines:
        console.print(line, markup=False, highlight=False, soft_wrap=True)
    if report.table is not None:
        console.print(report.table)
    for file in report.files:
        console.print(str(file), markup=False, highlight=False, soft_wrap=True)
