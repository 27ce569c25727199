"""Command line of the study: `python -m studies.recordings`."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from agents import run_command
from studies.recordings import study
from studies.recordings.objects import WORLDS
from studies.results import save_results

DECIDERS = (
    "threshold:0.6",
    "steady",
    "threshold:0.7",
    "threshold:0.9",
    "beam-adaptive",
    "shipped",
    study.HINDSIGHT,
)


@dataclass(kw_only=True)
class Recordings:
    """Compare deciders on recordings of objects of any size, with nothing given.

    The default takes about eight minutes on one core.
    """

    deciders: Annotated[tuple[str, ...], tyro.conf.Positional] = DECIDERS
    """Names with their thresholds, hindsight, or hindsight:10 for a live tracker that decides ten
    ticks later, which are drawn; the others are compared with the first.
    """
    seed: int = 0
    """Seed of the first recording."""
    known_radii: bool = False
    """Give the radius of each object."""
    jobs: int = -1
    """Number of processes; -1 for one on each core. The results do not depend on it."""
    quick: bool = False
    """Compare two deciders on four recordings."""
    out: Path = Path("results")
    """Folder for recordings.md, recordings.json and, of ticks later, recordings.png."""

    def run(self) -> None:
        """Track the recordings, print the tables and write the files."""
        worlds = WORLDS[4:6] if self.quick else WORLDS
        if self.known_radii:
            worlds = tuple((name, f"{kind}, known radius") for name, kind in worlds)
        rows = study.evaluate(
            self.deciders[:2] if self.quick else self.deciders,
            worlds,
            2 if self.quick else 12,
            self.seed,
            self.jobs,
        )
        figure = study.draw_lags(rows)
        save_results(self.out / "recordings", study.markdown(rows), rows, figure)


if __name__ == "__main__":
    sys.exit(run_command(Recordings, "python -m studies.recordings"))
