"""Command line of the study: `python -m studies.radius`."""

import sys
from dataclasses import dataclass
from pathlib import Path

from agents import run_command
from studies.radius import study
from studies.results import save_results


@dataclass(kw_only=True)
class Radius:
    """Compare the radius that is estimated after a decision with those of the bank.

    The default takes about three minutes on one core.
    """

    variances: tuple[float, ...] = (0.01, 0.1, 1.0)
    """Measurement variances R."""
    ratios: tuple[float, ...] = (0.8, 1.0, 1.25)
    """True radii over that of the bank."""
    tracks: int = 500
    """Number of tracks of each variance and radius."""
    seed: int = 0
    """Seed of the tracks."""
    jobs: int = -1
    """Number of processes; -1 for one on each core. The results do not depend on it."""
    quick: bool = False
    """Evaluate 20 tracks of one variance and two radii."""
    out: Path = Path("results")
    """Folder for radius.md, radius.json and radius.png."""

    def run(self) -> None:
        """Evaluate the tracks, print the table and write the files."""
        variances, ratios, tracks = self.variances, self.ratios, self.tracks
        if self.quick:
            variances, ratios, tracks = (0.01,), (1.0, 1.25), 20
        rows = study.evaluate(variances, ratios, tracks, self.seed, self.jobs)
        save_results(self.out / "radius", study.markdown(rows), rows, study.figure(rows))


if __name__ == "__main__":
    sys.exit(run_command(Radius, "python -m studies.radius"))
