"""Command line of the study: `python -m studies.shifts`."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from agents import run_command, task_of
from studies.results import save_results
from studies.shifts import study


@dataclass(kw_only=True)
class Shifts:
    """Evaluate deciders in other environments than the nominal one.

    The default takes about an hour on one core.
    """

    deciders: Annotated[tuple[str, ...], tyro.conf.Positional] = (
        "shipped",
        "propagated",
        "propagated-robust",
    )
    """Deciders without thresholds; the first is compared with the best of the others."""
    env: str = "HybridTrackPublished-v0"
    """Registered id of the nominal environment."""
    shifted: bool = True
    """Environments with one property changed (noise, radii, segment lengths, speed, outliers); with
    unknown switches, laws of the durations and orders of the modes.
    """
    drawn: int = 0
    """Number of random environments, from ranges twice as wide at both ends as in the training of
    the shipped agent.
    """
    episodes: int = 1000
    """Number of episodes; at most 1,000 others serve to select each threshold."""
    jobs: int = -1
    """Number of processes; -1 for one on each core. The results do not depend on it."""
    quick: bool = False
    """Evaluate two rules on 10 episodes of the nominal environment and a random one."""
    out: Path = Path("results")
    """Folder for shifts.md and shifts.json."""

    def run(self) -> None:
        """Evaluate the deciders, print the table and write the files."""
        task = task_of(self.env)
        names, worlds = self.deciders, study.worlds_of(task, self.shifted, self.drawn)
        if self.quick:
            names, worlds = ("msprt", "ate"), study.worlds_of(task, False, 1)
        episodes = 10 if self.quick else self.episodes
        rows = study.evaluate(names, self.env, worlds, episodes, self.jobs)
        save_results(self.out / "shifts", study.markdown(rows), rows)


if __name__ == "__main__":
    sys.exit(run_command(Shifts, "python -m studies.shifts"))
