"""The command `hybridtrack reproduce`: published tables and figures next to reproduced ones."""

import functools
import pkgutil
import time
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
import tyro
from rich.console import Console
from rich.markdown import Markdown

from agents.evaluation.cells import markdown_table
from agents.interface.output_files import output_folder, write_files
from agents.interface.parallel import ParallelArguments
from agents.interface.progress import print_lines, progress_display
from agents.reproduction import figures
from baselines.papers.reproduction import Cell, Reproduction
from hybrid_env.checks import check_integer, reject

# Has a folder for its finished parts, and parallel parts itself.
RADAR_STUDY = "novospaskyi"
# Take some minutes and run on request only.
LONG = (RADAR_STUDY, "multiple_models")
# All papers with figures here, in the order of the years in their names, those without one last.
MODULES = [module.name for module in pkgutil.iter_modules(figures.__path__)]
PAPERS = tuple(sorted(MODULES, key=lambda name: "".join(filter(str.isdigit, name)) or "9999"))

if TYPE_CHECKING:
    Paper = str
else:
    Paper = Literal[PAPERS]


@dataclass(kw_only=True)
class Reproduce(ParallelArguments):
    """Reproduce the published studies.

    Prints every published value, the reproduced value, and the 95 % interval of a study of the
    paper's size.
    """

    papers: Annotated[tuple[Paper, ...], tyro.conf.Positional] = tuple(
        paper for paper in PAPERS if paper not in LONG
    )
    """Papers to reproduce; by default all but novospaskyi and multiple_models, which take some
    minutes. The latter is ATE against the IMM, GPB1, GPB2 and the static multiple model.
    """
    runs: int | None = None
    """Number of runs of each study, 1000 by default and 100 for multiple_models; Golubkov and
    Tsyganov used
    100. For novospaskyi the number of seeds of the noise, 10 by default.
    """
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
        workers, folder, console = (
            self.workers(),
            output_folder("out", self.out),
            Console(emoji=False),
        )
        options = {"seed": self.seed} | ({} if self.runs is None else {"runs": self.runs})
        calls = {
            paper: functools.partial(_reproduce, paper, options)
            for paper in self.papers
            if paper != RADAR_STUDY
        }
        with progress_display(console) as progress:
            task = progress.add_task("Reproducing", total=len(self.papers), note="")
            found = dict(
                workers.results(calls, lambda paper: progress.update(task, advance=1, note=paper))
            )
            if RADAR_STUDY in self.papers:
                bar = progress.add_task(RADAR_STUDY, total=None, note="flights")

                def show(stage: str, done: int, total: int) -> None:
                    progress.update(
                        bar,
                        completed=done,
                        total=total,
                        note=f"{stage}: {done} of {total}",
                    )

                own = {
                    "folder": folder / RADAR_STUDY / "point-mass",
                    "run": workers.results,
                    "progress": show,
                }
                found[RADAR_STUDY] = _reproduce(RADAR_STUDY, options | own)
                progress.remove_task(bar)
                progress.advance(task)
            progress.update(task, note="")
        for paper in self.papers:
            result, seconds = found[paper]
            text, cells = to_markdown(result), [cell.as_json() for cell in result.cells]
            values = {
                "paper": result.paper,
                "runs": result.runs,
                "seed": result.seed,
                "cells": cells,
            }
            values |= {"findings": [vars(finding) for finding in result.findings]}
            drawn = import_module(f"{figures.__name__}.{paper}").draw(result)
            console.print(Markdown(text))
            files = write_files(
                folder,
                {
                    f"{paper}.md": text,
                    f"{paper}.json": values,
                    **drawn,
                },
            )
            print_lines(console, f"{describe_runs(result)} Computed in {seconds:.2f} s. {files}\n")
        write_files(
            folder,
            {"reproduction.md": summary_markdown([found[paper][0] for paper in self.papers])},
        )
        print_lines(console, f"Summary: {folder / 'reproduction.md'}")


def _reproduce(paper: str, options: dict[str, Any]) -> tuple[Any, float]:
    started = time.perf_counter()
    result = import_module(f"baselines.papers.{paper}").reproduce(**options)
    return result, time.perf_counter() - started


HEADER = (
    "setting",
    "quantity",
    "published",
    "ours [its own interval]",
    "median run",
    "95 % interval",
    "inside",
)
INSIDE = {
    "inside": "yes",
    "outside": "no",
    "not published": "-",
}
FINDINGS_HEADER = ("quantity", "result", "claim of the paper")
SUMMARY_HEADER = (
    "paper, its size",
    "table",
    "inside the 95 % interval",
    "outside the 95 % interval",
    "not counted",
)


def _row(cell: Cell) -> tuple[str, ...]:
    """Texts of a cell, in the order of `HEADER`."""

    def text(*values: float) -> str:
        return (
            "-"
            if np.isnan(values).any()
            else " to ".join(f"{value:.{cell.digits}f}" for value in values)
        )

    own = text(cell.own_low, cell.own_high)
    ours = text(cell.ours) + (f" [{own}]" if own != "-" else "")
    verdict = INSIDE[cell.verdict] + (f" ({cell.excuse})" if cell.excuse else "")
    interval = text(cell.low, cell.high)
    return cell.row, cell.column, text(cell.published), ours, text(cell.median), interval, verdict


def describe_runs(result: Reproduction) -> str:
    """Number of runs and seed, with a recommendation if there are few runs."""
    least = result.recommended_runs
    few = f" At least {least} runs are recommended." if result.runs < least else ""
    return f"{result.runs} runs, seed {result.seed}.{few}"


def _unpublished(cells: Sequence[Cell]) -> str:
    """Rows beside columns of a table without published values; "" if it has some, or not all of
    ours.
    """
    values = {
        (row, column): f"{ours} ({interval})"
        for row, column, _, ours, _, interval, _ in map(_row, cells)
    }
    rows, columns = (list(dict.fromkeys(names)) for names in zip(*values, strict=True))
    if len(values) < len(rows) * len(columns) or any(
        cell.verdict != "not published" for cell in cells
    ):
        return ""
    return markdown_table(
        ("", *columns),
        [(row, *(values[row, one] for one in columns)) for row in rows],
    )


def to_markdown(result: Reproduction) -> str:
    """All tables of one paper."""
    text = [f"# Reproduction of {result.paper}\n", f"{describe_runs(result)}\n"]
    for name, cells in result.tables.items():
        inside, total = result.count().get(name, {}).get("", (0, 0))
        count = f", {inside} of {total} inside the interval" if total else ""
        notes = " ".join(dict.fromkeys(cell.note for cell in cells if cell.note))
        text += [f"## {result.paper}: {name}{count}\n", f"{notes}\n"]
        text += [_unpublished(cells) or markdown_table(HEADER, [_row(cell) for cell in cells])]
    rows = [(finding.name, finding.value, finding.claim) for finding in result.findings]
    text += ["## Additional results\n", markdown_table(FINDINGS_HEADER, rows)]
    return "\n".join(text)


def summary_markdown(results: Sequence[Reproduction]) -> str:
    """Number of published values inside the interval by table, and the values outside."""
    rows = []
    for result in results:
        for name, counts in result.count().items():
            inside, total = counts.pop("", (0, 0))
            outside = [
                "{} {} {} (ours {})".format(*_row(cell))
                for cell in result.tables[name]
                if cell.verdict == "outside" and not cell.excuse
            ]
            others = [f"{excuse}: {own} of {all_} inside" for excuse, (own, all_) in counts.items()]
            count, none = (f"{inside} of {total}", "none") if total else ("-", "-")
            outsiders = "; ".join(outside) or none
            excused = "; ".join(others) or "none"
            rows.append((f"{result.paper}, {result.size}", name, count, outsiders, excused))
    return markdown_table(SUMMARY_HEADER, rows)
