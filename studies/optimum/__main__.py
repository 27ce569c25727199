"""Command line of the study: `python -m studies.optimum`."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from agents import run_command
from studies.optimum import study
from studies.results import save_results


@dataclass(kw_only=True)
class Optimum:
    """Compare the IMM, the beam and the shipped agent with the exact posterior of the mode.

    The default takes about four minutes on one core.
    """

    worlds: tuple[Literal["paths", "default"], ...] = ("paths", "default")
    """Tracks: 12 ticks without process noise, or the first 65 ticks of HybridTrackQuickest-v0."""
    variances: tuple[float, ...] = (0.01, 0.1, 1.0)
    """Measurement variances R."""
    episodes: int = 150
    """Number of tracks of each variance; a third as many others serve to select thresholds."""
    seed: int = 0
    """Seed of the first track, below 10^9."""
    nodes: int = 7
    """Number of speeds at the beginning of a turn over which the posterior is averaged."""
    jobs: int = 1
    """Number of processes; -1 for one on each core. The results do not depend on it."""
    quick: bool = False
    """Evaluate 20 tracks of 12 ticks, with one variance."""
    out: Path = Path("results")
    """Folder for optimum.md, optimum.json and optimum.png."""

    def run(self) -> None:
        """Evaluate the deciders, print the tables and write the files."""
        worlds, variances, episodes = self.worlds, self.variances, self.episodes
        if self.quick:
            worlds, variances, episodes = ("paths",), (0.1,), 20
        rows = study.evaluate_all(worlds, variances, episodes, self.seed, self.nodes, self.jobs)
        save_results(self.out / "optimum", study.markdown(rows), rows, study.figure(rows))


if __name__ == "__main__":
    sys.exit(run_command(Optimum, "python -m studies.optimum"))
