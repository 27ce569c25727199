"""The study of Novospaskyi 2025 with its progress display."""

import os
from pathlib import Path

from rich.progress import Progress

from baselines.papers import novospaskyi
from baselines.papers.reproduction import Reproduction

FOLDER = "novospaskyi"
"""Folder in the output folder for finished trials and flights, from which a killed run goes on."""

MOST_WORKERS = 8


def run_study(runs: int | None, seed: int, physics: bool, out: Path, progress: Progress) -> Reproduction:
    """Run the study on all processor cores, with a line of its own in a progress display.

    Args:
        runs: number of seeds of the noise; None takes that of the study.
        seed: of flights, radars, noise and tuning.
        physics: fly a quadrotor in PyBullet.
        out: output folder of the command.
        progress: the display.

    Raises:
        ArgumentError: PyBullet is not installed, or the folder cannot be written.
    """
    task = progress.add_task(FOLDER, total=None, note="flights")

    def show(stage: str, done: int, total: int) -> None:
        progress.update(task, completed=done, total=total, note=f"{stage}: {done} of {total}")

    result = novospaskyi.reproduce(
        novospaskyi.RUNS if runs is None else runs, seed, folder=out / FOLDER, physics=physics,
        workers=min(os.cpu_count() or 1, MOST_WORKERS), progress=show,
    )  # fmt: skip
    progress.remove_task(task)
    return result
