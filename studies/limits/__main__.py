"""Command line of the study: `python -m studies.limits`."""

import json
import sys
from dataclasses import dataclass
from pathlib import Path

import joblib
from rich.progress import track

from agents import find_family, run_command, task_of
from baselines import Estimate
from studies.limits import report, study


@dataclass(kw_only=True)
class Limits:
    """Evaluate every classical rule on every filter bank and noise level.

    The default takes about two hours on one core, 1,500 episodes one hour; with unknown switch
    moments about an hour.
    """

    unknown: bool = False
    """Evaluate rules for unknown switch moments, in HybridTrackQuickest-v0."""
    deciders: tuple[str, ...] = ()
    """Further deciders to evaluate on every filter bank with known switch moments, as
    'mine.py:MyRule'.
    """
    episodes: int = 3000
    """Number of episodes per rule; a third as many others serve to select thresholds."""
    seed: int = 0
    """Seed of the first episode, below 10^9."""
    jobs: int = -1
    """Number of processes; -1 for one on each core. The results do not depend on it."""
    quick: bool = False
    """Evaluate one noise level, with three hypotheses or one law of durations, on 10 episodes."""
    out: Path = Path("results")
    """Folder for limits.md, limits.json and limits.png."""

    def run(self) -> None:
        """Evaluate the rules, print the tables and write the files."""
        for name in self.deciders:
            for env_id in study.RULES:
                find_family(name, task_of(env_id).options)
        episodes = 10 if self.quick else self.episodes
        parts = study.calls(
            self.unknown,
            episodes,
            self.seed,
            self.deciders,
            self.quick,
        )
        parallel = joblib.Parallel(n_jobs=self.jobs, return_as="generator")
        rows = {}
        for part, calls in parts.items():
            results = track(parallel(joblib.delayed(call)() for call in calls), part, len(calls))
            rows[part] = [row for result in results for row in result]
        text = report.markdown(rows)
        print(text)
        self.out.mkdir(parents=True, exist_ok=True)
        (self.out / "limits.md").write_text(text, encoding="utf-8")
        (self.out / "limits.json").write_text(json.dumps(rows, indent=2, default=Estimate.as_json))
        report.figure(rows).savefig(self.out / "limits.png")


if __name__ == "__main__":
    sys.exit(run_command(Limits, "python -m studies.limits"))
