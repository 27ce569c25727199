"""Command line of the study: `python -m studies.simulators`."""

import importlib.util
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import joblib
import tyro

from agents import find_decider, run_command
from hybrid_env import ArgumentError
from studies.results import in_parallel, save_results
from studies.seal import current_seal, unbroken_seal
from studies.simulators import study
from studies.simulators.worlds import worlds

SEAL = Path(__file__).with_name("sealed.json")
"""What was fixed before the closed paths were opened."""


@dataclass(kw_only=True)
class Simulators:
    """Evaluate an agent on aircraft of JSBSim, airliners of BlueSky and cars of SUMO, beside rules
    that are tuned in each of their worlds.

    The default has 10 h of paths in each of 81 worlds.
    """

    simulators: tuple[Literal["jsbsim", "bluesky", "sumo"], ...] = ("jsbsim", "bluesky", "sumo")
    """Simulators, each with 27 worlds of three kinds, ticks and noises."""
    deciders: Annotated[tuple[str, ...], tyro.conf.Positional] = (
        str(Path(__file__).with_name("shipped")),
        "threshold",
        "beam",
        "beam-geometric",
        "cusum",
    )
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
        if not 0 <= self.seed <= study.SELECTION - self.episodes:
            raise ArgumentError(f"seed={self.seed} is not allowed: expected a number below 10^9")
        seed = self.seed
        if self.sealed:
            unbroken_seal(SEAL)
            # Seed of the first closed path.
            seed = 7_000_000_000
        episodes = 2 if self.quick else self.episodes
        places = worlds(self.simulators, self.quick)
        for name in self.deciders:
            find_decider(name, places[0].options())
        calls = [
            joblib.delayed(study.compare)(place, self.deciders, episodes, seed) for place in places
        ]
        rows = in_parallel(calls, self.jobs, "worlds")
        content = {"worlds": rows, "counts": study.counts(rows), "seal": current_seal(SEAL)}
        save_results(self.out / "simulators", study.markdown(rows), content, study.figure(rows))


if __name__ == "__main__":
    sys.exit(run_command(Simulators, "python -m studies.simulators"))
