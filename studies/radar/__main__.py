"""Radar tracks of flights and filters on them: `python -m studies.radar`."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from agents import run_command
from hybrid_env import ArgumentError
from studies.radar.dataset import load_radar_data, write_radar_data
from studies.radar.flights import FLIGHTS
from studies.radar.scores import radar_tables, score_radar_data
from studies.radar.tuning import TRIALS
from studies.results import save_results


@dataclass(kw_only=True)
class Radar:
    """Write the radar data set, or score filters on it."""

    part: Annotated[Literal["data", "scores"], tyro.conf.Positional] = "data"
    """'data' writes the data set. 'scores' tunes and scores the filters of the thesis and better
    ones on it, about ten minutes of one core; a data set in the folder is read, and a killed run
    goes on where it was.
    """
    out: Path = Path("radar")
    """Output folder."""
    seed: int = 0
    """Seed of flights, radars, noise and tuning."""
    jobs: int = -1
    """Number of processes; -1 for one on each core. The results do not depend on it."""
    quick: bool = False
    """Few flights and trials, to see the form of the result."""

    def run(self) -> None:
        """Do the part, print its tables and write its files."""
        self.out.mkdir(parents=True, exist_ok=True)
        flights, trials = (40, 2) if self.quick else (FLIGHTS, TRIALS)
        if self.part == "data" or not (self.out / "dataset.json").exists():
            write_radar_data(self.out, self.seed, flights)
        data = load_radar_data(self.out)
        if data.seed != self.seed:
            raise ArgumentError(f"seed={self.seed}: the data set has the seed {data.seed}")
        if self.part == "data":
            counts = [f"{len(flown)} {split} flights" for split, flown in data.flights.items()]
            print(f"Data {self.out}: {', '.join(counts)}")
            return
        scores = score_radar_data(data, self.out / "scores", trials, self.jobs)
        save_results(self.out / "scores", *radar_tables(scores))


if __name__ == "__main__":
    sys.exit(run_command(Radar, "python -m studies.radar"))
