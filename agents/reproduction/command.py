"""The command `hybridtrack reproduce`: published tables and figures next to reproduced ones."""

import functools
import time
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args

import tyro

from agents.interface.parallel_arguments import ParallelArguments
from hybrid_env.checks import check_integer, reject

if TYPE_CHECKING:
    from agents.interface.parallel import Call

Paper = Literal["golubkov2018", "tsyganov2019", "golubkov2020", "zimchuk", "novospaskyi"]
PAPERS: tuple[Paper, ...] = tuple(paper for paper in get_args(Paper) if paper != "novospaskyi")
RUNS = 1000


@dataclass(kw_only=True)
class Reproduce(ParallelArguments):
    """Reproduce the published studies.

    Prints every published value, the reproduced value, and the 95 % interval of a study of the paper's size.
    """

    papers: Annotated[tuple[Paper, ...], tyro.conf.Positional] = PAPERS
    """Papers to reproduce; by default all but novospaskyi, which takes some minutes."""
    runs: int | None = None
    """Number of runs of each study, 1000 by default; Golubkov and Tsyganov used 100. For novospaskyi the
    number of seeds of the noise, 10 by default."""
    physics: bool = False
    """novospaskyi: fly a quadrotor in PyBullet (extra `physics`) in place of a point mass."""
    seed: int = 0
    """Seed of the simulated recordings."""
    out: Path = Path("results")
    """Output folder for the tables (Markdown and JSON) and the figures."""

    def run(self) -> None:
        """Run the studies, print the tables and write the files.

        Raises:
            ArgumentError: an argument is out of range, or the output folder cannot be written.
        """
        if self.runs is not None:
            check_integer("runs", self.runs, minimum=2)
        check_integer("seed", self.seed, minimum=0)
        if not self.papers or len(set(self.papers)) != len(self.papers):
            raise reject("papers", self.papers, "one or more papers, each at most once")
        if self.physics and "novospaskyi" not in self.papers:
            raise reject("papers", self.papers, "novospaskyi, with --physics")
        from rich.console import Console

        from agents.interface.output_files import atomic_file, output_folder, write_json
        from agents.interface.progress import progress_display
        from agents.reproduction.figures import draw_figures
        from agents.reproduction.novospaskyi_study import run_study
        from agents.reproduction.report import describe_runs, summary_markdown, tables, to_json, to_markdown

        workers = self.workers()
        folder = output_folder("out", self.out)
        console = Console(emoji=False)
        runs = RUNS if self.runs is None else self.runs
        others = [paper for paper in self.papers if paper != "novospaskyi"]  # which shows its own progress
        calls: dict[Paper, Call] = {
            paper: functools.partial(_reproduce, paper, runs, self.seed) for paper in others
        }
        with progress_display(console) as progress:
            task = progress.add_task("Reproducing", total=len(self.papers), note="")
            found = dict(workers.results(calls, lambda paper: progress.update(task, advance=1, note=paper)))
            if "novospaskyi" in self.papers:
                progress.update(task, note="novospaskyi")
                started = time.perf_counter()
                study = run_study(self.runs, self.seed, self.physics, folder, progress)
                found["novospaskyi"] = study, time.perf_counter() - started
                progress.advance(task)
            progress.update(task, note="")
        for paper in self.papers:
            result, seconds = found[paper]
            for table in tables(result):
                console.print(table)
            write_json(folder / f"{paper}.json", to_json(result))
            with atomic_file(folder / f"{paper}.md") as part:
                part.write_text(to_markdown(result), encoding="utf-8")
            names = draw_figures(paper, result, folder)
            files = ", ".join([f"{paper}.md", f"{paper}.json", *names])
            console.print(
                f"{describe_runs(result)} Computed in {seconds:.2f} s. Files in {folder}: {files}\n",
                markup=False,
                highlight=False,
            )
        with atomic_file(folder / "reproduction.md") as part:
            part.write_text(summary_markdown([found[paper][0] for paper in self.papers]), encoding="utf-8")
        console.print(f"Summary: {folder / 'reproduction.md'}", markup=False, highlight=False)


def _reproduce(paper: str, runs: int, seed: int) -> tuple[Any, float]:
    """Return the reproduction of a paper and the seconds that it took."""
    started = time.perf_counter()
    result = import_module(f"baselines.papers.{paper}").reproduce(runs, seed)
    return result, time.perf_counter() - started
