"""The command `hybridtrack limits`: what limits decisions, how far each rule gets, and where
models are wrong.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from rich.console import Console
from rich.markdown import Markdown

from agents.evaluation.registry import find_family
from agents.evaluation.tasks import QUICKEST, THREE, task_of
from agents.interface.help_texts import shown_default
from agents.interface.output_files import output_folder, write_files
from agents.interface.parallel import ParallelArguments
from agents.interface.progress import print_lines, shown
from agents.interface.world_arguments import TrustArguments
from agents.studies import departures, limits
from baselines.rules import seeds
from hybrid_env.checks import check_integer, reject


@dataclass(kw_only=True)
class Limits(TrustArguments, ParallelArguments):
    """Evaluate every classical rule on every filter bank and noise level.

    The default takes about two hours on one core, 1,500 episodes one hour. With
    --env HybridTrackQuickest-v0, rules for unknown switch moments are evaluated, in about an hour.
    """

    env: Annotated[
        str | None, shown_default("HybridTrackPublished-v0 and HybridTrackPublishedBank-v0")
    ] = None
    """'HybridTrackQuickest-v0'."""
    departures: bool = False
    """Evaluate deciders in worlds that depart from what they are told, step by step (heavy tails,
    process noise, radii, durations), beside the best rule that is told; 200 episodes take about 20
    minutes.
    """
    deciders: tuple[str, ...] = ()
    """Further deciders to evaluate on every filter bank with known switch moments, as
    'mine.py:MyRule'; with --departures in HybridTrackPublished-v0 only.
    """
    episodes: int = 3000
    """Number of episodes per rule; a third as many others serve to select thresholds."""
    seed: int = 0
    """Seed of the first episode."""
    out: Path = Path("results")
    """Folder for limits.md, limits.json and limits.png; with --departures for departures.md and
    so on.
    """

    def run(self) -> None:
        """Evaluate the rules, print the tables and write the files."""
        check_integer("episodes", self.episodes, minimum=10)
        check_integer("seed", self.seed, minimum=0)
        workers = self.workers()
        quickest = QUICKEST.rpartition(":")[2]
        if self.env not in (None, quickest, QUICKEST):
            raise reject("env", self.env, f"{quickest}, or no --env for the others")
        if self.deciders and self.env is not None:
            raise reject(
                "deciders",
                self.deciders,
                f"none in {quickest}, where compare evaluates them",
            )
        for name in self.deciders:
            for env in (THREE,) if self.departures else limits.RULES:
                find_family(name, task_of(env).options)
        largest = max(self.episodes, limits.CALIBRATION_EPISODES)
        if self.seed + largest > seeds.SELECTION:
            raise reject("seed", self.seed, f"at most {seeds.SELECTION - largest}")
        if self.departures and self.env is not None:
            raise reject("env", self.env, "no value with --departures")
        folder = output_folder("out", self.out)
        console = Console(emoji=False)
        study: Any
        if self.departures:
            name = "departures"
            study = departures
            by_part = {name: departures.calls(self.deciders, self.episodes, self.seed)}
        else:
            name = "limits"
            study = limits
            by_part = limits.calls(
                "" if self.env is None else QUICKEST,
                self.episodes,
                self.seed,
                self.deciders,
            )
        every = {name: call for part in by_part.values() for name, call in part.items()}
        found = shown(
            console,
            "Evaluating",
            len(every),
            lambda note: dict(workers.results(every, note)),
        )
        parts = {
            part: [row for name in named for row in found[name]] for part, named in by_part.items()
        }
        data = parts.get("departures", parts)
        files = {
            f"{name}.md": study.markdown(data),
            f"{name}.json": data,
            f"{name}.png": study.figure(data),
        }
        console.print(Markdown(files[f"{name}.md"]))
        print_lines(console, write_files(folder, files))
