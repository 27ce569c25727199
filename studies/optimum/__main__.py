"""Command line of the study: `python -m studies.optimum`."""

import sys
from dataclasses import dataclass
from pathlib import Path

from agents import run_command
from studies.optimum import study
from studies.results import save_results


@dataclass(kw_only=True)
class Optimum:
    """Compare the IMM, the beam and the shipped agent with the exact posterior of the mode.

    The default takes about four minutes on one core.
    """

    jobs: int = 1
    """Number of processes; -1 for one on each core. The results do not depend on it."""
    quick: bool = False
    """Evaluate 20 tracks of 12 ticks, with one measurement variance."""
    out: Path = Path("results")
    """Folder for optimum.md, optimum.json and optimum.png."""

    def run(self) -> None:
        """Evaluate the deciders, print the tables and write the files."""
        rows = study.evaluate_all(self.quick, self.jobs)
        save_results(self.out / "optimum", study.markdown(rows), rows, study.figure(rows))


if __name__ == "__main__":
    sys.exit(run_command(Optimum, "python -m studies.optimum"))
