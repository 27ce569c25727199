"""The command `hybridtrack reproduce`: published tables and figures next to reproduced ones."""

import functools
import os
import pkgutil
import time
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from agents.interface.parallel import ParallelArguments
from agents.reproduction import figures
from hybrid_env.checks import check_integer, reject

RADAR_STUDY = "novospaskyi"  # has a folder for its finished parts and processes of its own
LONG = (RADAR_STUDY, "multiple_models")  # take some minutes and run on request only
MOST_PROCESSES = 8  # of the radar study
# all papers with figures here, in the order of the years in their names, those without one last
MODULES = [module.name for module in pkgutil.iter_modules(figures.__path__)]
PAPERS = tuple(sorted(MODULES, key=lambda name: "".join(filter(str.isdigit, name)) or "9999"))

if TYPE_CHECKING:
    from rich.progress import Progress

    Paper = str
else:
    Paper = Literal[PAPERS]


@dataclass(kw_only=True)
class Reproduce(ParallelArguments):
    """Reproduce the published studies.

    Prints every published value, the reproduced value, and the 95 % interval of a study of the paper's size.
    """

    papers: Annotated[tuple[Paper, ...], tyro.conf.Positional] = tuple(paper for paper in PAPERS if paper not in LONG)
    """Papers to reproduce; by default all but novospaskyi and multiple_models, which take some minutes. The
    latter is ATE against the IMM, GPB1, GPB2 and the static multiple model."""
    runs: int | None = None
    """Number of runs of each study, 1000 by default and 100 for multiple_models; Golubkov and Tsyganov used
    100. For novospaskyi the number of seeds of the noise, 10 by default."""
    seed: int = 0
    """Seed of the simulated recordings."""
    out: Path = Path("results")
    """Output folder for the tables (Markdown and JSON) and the figures."""

    def run(self) -> None:
        """Run the studies, print the tables and write the files."""
        if self.runs is not None:
            check_integer("runs", self.runs, minimum=2)
        check_integer("seed", self.seed, minimum=0)
        if not self.papers or len(set(self.papers)) != len(self.papers):
            raise reject("papers", self.papers, "one or more papers, each at most once")
        from rich.console import Console

        from agents.interface.output_files import output_folder, write_files
        from agents.interface.progress import progress_display
        from agents.reproduction.report import print_report, summary_markdown

        workers, folder, console = self.workers(), output_folder("out", self.out), Console(emoji=False)
        options = {"seed": self.seed} | ({} if self.runs is None else {"runs": self.runs})
        calls = {paper: functools.partial(_reproduce, paper, options) for paper in self.papers if paper != RADAR_STUDY}
        with progress_display(console) as progress:
            task = progress.add_task("Reproducing", total=len(self.papers), note="")
            found = dict(workers.results(calls, lambda paper: progress.update(task, advance=1, note=paper)))
            if RADAR_STUDY in self.papers:
                progress.update(task, note=RADAR_STUDY)
                found[RADAR_STUDY] = self._reproduce_radar_study(options, folder, progress)
                progress.advance(task)
            progress.update(task, note="")
        for paper in self.papers:
            result, seconds = found[paper]
            drawn = import_module(f"{figures.__name__}.{paper}").draw(result)
            print_report(paper, result, drawn, seconds, folder, console)
        write_files(folder, {"reproduction.md": summary_markdown([found[paper][0] for paper in self.papers])})
        console.print(f"Summary: {folder / 'reproduction.md'}", markup=False, highlight=False)

    def _reproduce_radar_study(self, options: dict[str, Any], folder: Path, progress: "Progress") -> tuple[Any, float]:
        """Run the radar study on all processor cores, with a line of its own in the progress display."""
        from agents.interface.parallel import Workers

        task = progress.add_task(RADAR_STUDY, total=None, note="flights")

        def show(stage: str, done: int, total: int) -> None:
            progress.update(task, completed=done, total=total, note=f"{stage}: {done} of {total}")

        run = Workers(min(os.cpu_count() or 1, MOST_PROCESSES)).results
        own = {"folder": folder / RADAR_STUDY / "point-mass", "run": run, "progress": show}
        found = _reproduce(RADAR_STUDY, options | own)
        progress.remove_task(task)
        return found


def _reproduce(paper: str, options: dict[str, Any]) -> tuple[Any, float]:
    """Return the reproduction of a paper and the seconds that it took."""
    started = time.perf_counter()
    result = import_module(f"baselines.papers.{paper}").reproduce(**options)
    return result, time.perf_counter() - started
