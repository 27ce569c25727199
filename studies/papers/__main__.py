"""Published tables and figures next to reproduced ones: `python -m studies.papers`."""

import json
import sys
import time
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Annotated, Literal

import tyro
from rich.console import Console
from rich.markdown import Markdown

from agents import run_command
from hybrid_env import ArgumentError
from studies.papers.report import describe_runs, summary_markdown, to_json, to_markdown

Paper = Literal["zimchuk", "golubkov2018", "tsyganov2019", "golubkov2020", "multiple_models"]
# Runs of the quick form.
QUICK = 20


@dataclass(kw_only=True)
class Reproduce:
    """Reproduce published studies.

    Prints every published value, the reproduced value, and the 95 % interval of a study of the
    paper's size, and writes tables and figures.
    """

    papers: Annotated[tuple[Paper, ...], tyro.conf.Positional] = (
        "golubkov2018",
        "tsyganov2019",
        "golubkov2020",
        "zimchuk",
    )
    """Papers to reproduce; multiple_models is ATE against the IMM, GPB1, GPB2 and the static
    multiple model, which takes some minutes.
    """
    runs: int | None = None
    """Number of runs of each study, at least 2; 1000 by default, and 100 for multiple_models.
    Golubkov and Tsyganov used 100.
    """
    seed: int = 0
    """Seed of the simulated recordings."""
    out: Path = Path("results/papers")
    """Output folder for the tables (Markdown and JSON) and the figures."""
    quick: bool = False
    """A few runs only, to see the form of the result."""

    def run(self) -> None:
        """Run the studies, print the tables and write the files."""
        if len(set(self.papers)) != len(self.papers):
            raise ArgumentError(f"papers={self.papers}: expected each paper at most once")
        if self.runs is not None and self.runs < 2:
            raise ArgumentError(f"runs={self.runs}: expected an integer >= 2")
        runs = QUICK if self.quick and self.runs is None else self.runs
        self.out.mkdir(parents=True, exist_ok=True)
        console = Console(emoji=False)
        results = []
        for paper in self.papers:
            study = import_module(f"studies.papers.{paper}")
            begun = time.perf_counter()
            with console.status(f"Reproducing {paper}"):
                result = study.reproduce(**({} if runs is None else {"runs": runs}), seed=self.seed)
            text = to_markdown(result)
            (self.out / f"{paper}.md").write_text(text, encoding="utf-8")
            values = json.dumps(
                to_json(result),
                indent=2,
                allow_nan=False,
            )
            (self.out / f"{paper}.json").write_text(values + "\n", encoding="utf-8")
            for name, figure in study.draw(result).items():
                figure.savefig(self.out / name)
            console.print(Markdown(text))
            print(f"{describe_runs(result)} Computed in {time.perf_counter() - begun:.1f} s.\n")
            results.append(result)
        summary = self.out / "reproduction.md"
        summary.write_text(summary_markdown(results), encoding="utf-8")
        print(f"Tables and figures: {self.out}, summary: {summary}")


if __name__ == "__main__":
    sys.exit(run_command(Reproduce, "python -m studies.papers"))
