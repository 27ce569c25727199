"""Radar tracks of flights, filters on them, and the thesis: `python -m studies.radar`."""

import json
import sys
from dataclasses import dataclass, field
from operator import methodcaller
from pathlib import Path
from typing import Annotated, Literal

import joblib
import tyro
from rich.console import Console
from rich.markdown import Markdown
from rich.progress import Progress

from agents import run_command
from hybrid_env import ArgumentError
from studies.papers.report import describe_runs, to_json, to_markdown
from studies.radar import figures
from studies.radar.dataset import load_radar_data, write_radar_data
from studies.radar.flights import FLIGHTS
from studies.radar.network import UPDATES
from studies.radar.reproduction import RUNS, TRIALS, reproduce
from studies.radar.scores import radar_figure, radar_json, radar_tables, score_radar_data


@dataclass(kw_only=True)
class Radar:
    """Write the radar data set, score filters on it, or reproduce the tables of the thesis."""

    part: Annotated[Literal["data", "scores", "thesis"], tyro.conf.Positional] = "data"
    """'data' writes the data set. 'scores' tunes and scores the filters of the thesis and better
    ones on it, six minutes of one core; a data set in the folder is read. 'thesis' is Novospaskyi
    2025, tables 3.5 and 3.6. A killed run of these goes on where it was.
    """
    out: Path = Path("radar")
    """Output folder."""
    seed: int = 0
    """Seed of flights, radars, noise and tuning."""
    runs: int = RUNS
    """Number of seeds of the noise of 'thesis'."""
    jobs: int = field(default_factory=joblib.cpu_count)
    """Number of processes; the results do not depend on it."""
    quick: bool = False
    """Few flights, trials and updates of the network, to see the form of the result."""

    def run(self) -> None:
        """Do the part, print its tables and write its files."""
        self.out.mkdir(parents=True, exist_ok=True)
        flights, trials, updates = (40, 2, 5) if self.quick else (FLIGHTS, TRIALS, UPDATES)
        with Progress(disable=not sys.stdout.isatty()) as progress:
            bar = progress.add_task("", total=None)

            def show(
                stage: str,
                done: int,
                total: int,
            ) -> None:
                progress.update(bar, description=stage, completed=done, total=total)

            if self.part == "thesis":
                found = reproduce(
                    1 if self.quick else self.runs,
                    self.seed,
                    folder=self.out / "point-mass",
                    flights=flights,
                    trials=trials,
                    jobs=self.jobs,
                    progress=show,
                )
            else:
                if self.part == "data" or not (self.out / "dataset.json").exists():
                    write_radar_data(self.out, self.seed, flights)
                data = load_radar_data(self.out)
                if data.seed != self.seed:
                    raise ArgumentError(f"seed={self.seed}: the data set has the seed {data.seed}")
                if self.part == "scores":
                    scores = score_radar_data(
                        data,
                        self.out / "scores",
                        trials,
                        updates,
                        self.jobs,
                        show,
                    )
        console = Console(emoji=False)
        if self.part == "data":
            counts = [f"{len(data.flights_of(split))} {split} flights" for split in data.tracks]
            print(f"Data {self.out}: {', '.join(counts)}")
        elif self.part == "scores":
            text = radar_tables(scores)
            print(text)
            (self.out / "scores.md").write_text(text, encoding="utf-8")
            estimates = radar_json(scores)
            self._write("scores.json", estimates)
            radar_figure(estimates).savefig(self.out / "scores.png")
        else:
            text = to_markdown(found)
            console.print(Markdown(text))
            print(describe_runs(found))
            (self.out / "thesis.md").write_text(text, encoding="utf-8")
            self._write("thesis.json", to_json(found))
            for name, figure in figures.draw(found).items():
                figure.savefig(self.out / name)
        print(f"Files: {self.out}")

    def _write(
        self,
        name: str,
        values: object,
    ) -> None:
        text = json.dumps(
            values,
            indent=2,
            default=methodcaller("as_json"),
        )
        (self.out / name).write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    sys.exit(run_command(Radar, "python -m studies.radar"))
