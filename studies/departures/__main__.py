"""Command line of the study: `python -m studies.departures`."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import joblib
import tyro

from agents import run_command
from studies.departures import study
from studies.results import in_parallel, save_results


@dataclass(kw_only=True)
class Departures:
    """Evaluate deciders in worlds that depart from what they are told, step by step, beside the
    best rule that is told. 200 episodes take about 20 minutes.
    """

    deciders: Annotated[tuple[str, ...], tyro.conf.Positional] = ()
    """Further deciders for announced switches and three hypotheses, as 'runs/ppo'."""
    episodes: int = 200
    """Number of episodes at each level; at most 1,000 others serve to select thresholds."""
    seed: int = 0
    """Seed of the first episode, below 10^9."""
    jobs: int = -1
    """Number of processes; -1 for one on each core. The results do not depend on it."""
    quick: bool = False
    """Evaluate rules only, at the ends of the roads, on 10 episodes."""
    out: Path = Path("results")
    """Folder for departures.md, departures.json and departures.png."""

    def run(self) -> None:
        """Evaluate the deciders, print the tables and write the files."""
        roads = study.quick_roads() if self.quick else study.all_roads(self.deciders)
        episodes = 10 if self.quick else self.episodes
        calls = [
            joblib.delayed(study.respond)(road, level, episodes, self.seed)
            for road in roads
            for level in road.levels
        ]
        rows = [row for part in in_parallel(calls, self.jobs, "levels") for row in part]
        save_results(self.out / "departures", study.markdown(rows), rows, study.figure(rows))


if __name__ == "__main__":
    sys.exit(run_command(Departures, "python -m studies.departures"))
