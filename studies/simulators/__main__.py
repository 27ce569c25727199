"""Command line of the study: `python -m studies.simulators`."""

import importlib.util
import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import joblib
from rich.progress import track

from agents import find_family, run_command
from baselines import Estimate
from hybrid_env import ArgumentError
from studies.simulators import seal, study
from studies.simulators.worlds import worlds


@dataclass(kw_only=True)
class Simulators:
    """Evaluate an agent on aircraft of JSBSim, airliners of BlueSky and cars of SUMO, beside rules
    that are tuned in each of their worlds.

    The default has 10 h of paths in each of 81 worlds.
    """

    simulators: tuple[Literal["jsbsim", "bluesky", "sumo"], ...] = ("jsbsim", "bluesky", "sumo")
    """Simulators, each with 27 worlds of three kinds, ticks and noises."""
    deciders: tuple[str, ...] = ("robust", "threshold", "beam", "beam-geometric", "cusum")
    """Deciders: an agent, for which nothing is selected, and rules that are tuned in each world."""
    episodes: int = 40
    """Number of paths of a quarter of an hour in each world, and of others for selection."""
    seed: int = 0
    """Seed of the first path, below 10^9."""
    sealed: bool = False
    """Measure the closed paths instead. Refused if code, weights or simulators are not those of
    the seal.
    """
    jobs: int = -1
    """Number of processes; -1 for one on each core. The results do not depend on it."""
    quick: bool = False
    """Evaluate one world of each simulator, on two paths of three minutes."""
    out: Path = Path("results")
    """Folder for simulators.md, simulators.json and simulators.png."""

    def run(self) -> None:
        """Evaluate the deciders, print the table and write the files."""
        for module in self.simulators:
            if importlib.util.find_spec(module) is None:
                advice = "pip install -r studies/simulators/requirements.txt"
                raise ArgumentError(f"{module} is missing: {advice}")
        if len(self.deciders) < 2:
            raise ArgumentError(f"deciders={self.deciders} is not allowed: expected two or more")
        if not 0 <= self.seed <= study.SELECTION - self.episodes:
            raise ArgumentError(f"seed={self.seed} is not allowed: expected a number below 10^9")
        seed = seal.first_closed_path() if self.sealed else self.seed
        episodes = 2 if self.quick else self.episodes
        places = worlds(self.simulators, self.quick)
        for name in self.deciders:
            find_family(name, places[0].options())
        calls = [
            joblib.delayed(study.compare)(
                place,
                self.deciders,
                episodes,
                seed,
            )
            for place in places
        ]
        parallel = joblib.Parallel(n_jobs=self.jobs, return_as="generator")
        rows = list(track(parallel(calls), total=len(calls)))
        text = study.markdown(rows)
        print(text)
        self.out.mkdir(parents=True, exist_ok=True)
        (self.out / "simulators.md").write_text(text, encoding="utf-8")
        content = {
            "worlds": rows,
            "counts": study.counts(rows),
            "seal": seal.current_seal(),
        }
        (self.out / "simulators.json").write_text(
            json.dumps(content, indent=2, default=Estimate.as_json),
            encoding="utf-8",
        )
        study.figure(rows).savefig(self.out / "simulators.png")


if __name__ == "__main__":
    sys.exit(run_command(Simulators, "python -m studies.simulators"))
