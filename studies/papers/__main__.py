"""Published tables next to reproduced ones: `python -m studies.papers`."""

import sys
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Annotated, Literal

import tyro

from agents import run_command
from studies.papers.published import summary, to_markdown
from studies.results import save_results


@dataclass(kw_only=True)
class Reproduce:
    """Reproduce published studies.

    Prints every published value, the reproduced value, and the 95 % interval of a study of the
    paper's size, and writes the tables.
    """

    papers: Annotated[
        tuple[Literal["zimchuk", "golubkov2018", "tsyganov2019", "golubkov2020"], ...],
        tyro.conf.Positional,
    ] = ("golubkov2018", "tsyganov2019", "golubkov2020", "zimchuk")
    """Papers to reproduce."""
    runs: int | None = None
    """Number of runs of each study, at least 2; 1000 by default. Golubkov and Tsyganov used 100."""
    out: Path = Path("results/papers")
    """Output folder for the tables (Markdown and JSON)."""
    quick: bool = False
    """20 runs only, to see the form of the result."""

    def run(self) -> None:
        """Run the studies, print the tables and write the files."""
        runs = 20 if self.quick and self.runs is None else self.runs
        results = []
        for paper in self.papers:
            study = import_module(f"studies.papers.{paper}")
            result = study.reproduce(*[runs] * (runs is not None))
            save_results(self.out / paper, to_markdown(result), result.as_json())
            results.append(result)
        (self.out / "reproduction.md").write_text(summary(results), encoding="utf-8")
        print(f"Summary: {self.out / 'reproduction.md'}")


if __name__ == "__main__":
    sys.exit(run_command(Reproduce, "python -m studies.papers"))
