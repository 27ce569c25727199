"""Command line of the study: `python -m studies.limits`."""

import sys
from dataclasses import dataclass
from pathlib import Path

from agents import run_command
from studies.limits import report, study
from studies.results import in_parallel, save_results


@dataclass(kw_only=True)
class Limits:
    """Evaluate every classical rule on every filter bank and noise level.

    The default takes about two hours on one core, 1,500 episodes one hour; with unknown switch
    moments about an hour.
    """

    unknown: bool = False
    """Evaluate rules for unknown switch moments, in HybridTrackQuickest-v0."""
    bound: bool = False
    """Evaluate the bound of the default ids only, with the best rule and the learned stop below it.
    """
    episodes: int = 3000
    """Number of episodes per rule; a third as many others serve to select thresholds."""
    jobs: int = -1
    """Number of processes; -1 for one on each core. The results do not depend on it."""
    quick: bool = False
    """Evaluate one noise level, with three hypotheses or one law of durations, on 10 episodes."""
    out: Path = Path("results")
    """Folder for limits.md and limits.json, and with known switch moments limits.png."""

    def run(self) -> None:
        """Evaluate the rules, print the tables and write the files."""
        episodes = 10 if self.quick else self.episodes
        parts = study.calls(self.unknown and not self.bound, episodes, self.quick)
        rows = {}
        for part in ("bound",) if self.bound else parts:
            results = in_parallel(parts[part], self.jobs, part)
            rows[part] = [row for result in results for row in result]
        picture = report.figure(rows["rules"]) if "rules" in rows else None
        save_results(self.out / "limits", report.markdown(rows), rows, picture)


if __name__ == "__main__":
    sys.exit(run_command(Limits, "python -m studies.limits"))
