"""The command `hybridtrack limits`: what limits decisions, how far each rule gets, and where models are wrong."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from agents.interface.help_texts import shown_default
from agents.interface.parallel import ParallelArguments
from agents.interface.trust import TrustArguments
from baselines.rules import seeds
from hybrid_env.checks import check_integer, reject


@dataclass(kw_only=True)
class Limits(TrustArguments, ParallelArguments):
    """Evaluate every classical rule on every filter bank and noise level.

    The default takes about two hours on one core, 1,500 episodes one hour. With
    --env HybridTrackQuickest-v0, rules for unknown switch moments are evaluated, in about an hour.
    """

    env: Annotated[str | None, shown_default("both environments with known switch moments")] = None
    """'HybridTrackQuickest-v0'."""
    departures: bool = False
    """Evaluate deciders in worlds that depart from what they are told, step by step (heavy tails, process noise,
    radii, durations), beside the best rule that is told; 1,000 episodes take about 20 minutes."""
    deciders: tuple[str, ...] = ()
    """Further deciders to evaluate on every filter bank with known switch moments, as 'mine.py:MyRule'."""
    episodes: int = 3000
    """Number of episodes per rule; a third as many others serve to select thresholds."""
    seed: int = 0
    """Seed of the first episode."""
    out: Path = Path("results")
    """Folder for limits.md, limits.json and limits.png; with --departures for departures.md and so on."""

    def run(self) -> None:
        """Evaluate the rules, print the tables and write the files."""
        check_integer("episodes", self.episodes, minimum=10)
        check_integer("seed", self.seed, minimum=0)
        workers = self.workers()
        from rich.console import Console
        from rich.markdown import Markdown

        from agents.evaluation.registry import find_family
        from agents.evaluation.tasks import task_of
        from agents.figures.canvas import save_figure
        from agents.interface.output_files import atomic_file, output_folder, write_json
        from agents.interface.progress import progress_display
        from agents.studies import departures
        from agents.studies.limits import CALIBRATION_EPISODES, QUICKEST_ENV, RULES, calls, limits_json
        from agents.studies.limits_report import limits_figure, limits_markdown

        quickest = QUICKEST_ENV.rpartition(":")[2]
        if self.env not in (None, quickest, QUICKEST_ENV):
            raise reject("env", self.env, f"{quickest}, or no --env for the others")
        if self.deciders and self.env is not None:
            raise reject("deciders", self.deciders, f"none in {quickest}, where compare evaluates them")
        for name in self.deciders:
            for env in RULES:
                find_family(name, task_of(env).options)
        largest = max(self.episodes, CALIBRATION_EPISODES)
        if self.seed + largest > seeds.SELECTION:
            raise reject("seed", self.seed, f"at most {seeds.SELECTION - largest}")
        if self.departures and self.env is not None:
            raise reject("env", self.env, "no value with --departures")
        folder = output_folder("out", self.out)
        console = Console(emoji=False)
        by_part = calls("" if self.env is None else QUICKEST_ENV, self.episodes, self.seed, self.deciders)
        if self.departures:
            by_part = {"departures": departures.calls(self.deciders, self.episodes, self.seed)}
        with progress_display(console) as progress:
            all_calls = {name: call for part in by_part.values() for name, call in part.items()}
            bar = progress.add_task("Evaluating", total=len(all_calls), note="")
            found = dict(workers.results(all_calls, lambda note: progress.update(bar, advance=1, note=note)))
            progress.update(bar, note="")
        parts = {part: [one for name in named for one in found[name]] for part, named in by_part.items()}
        metrics: Any
        if self.departures:
            responses = parts["departures"]
            name, text = "departures", departures.departures_markdown(responses)
            figure, metrics = departures.departures_figure(responses), [one.as_json() for one in responses]
        else:
            name, text = "limits", limits_markdown(parts)
            figure, metrics = limits_figure(parts), limits_json(parts)
        console.print(Markdown(text))
        with atomic_file(folder / f"{name}.md") as part:
            part.write_text(text, encoding="utf-8")
        write_json(folder / f"{name}.json", metrics)
        save_figure(figure, folder / f"{name}.png")
        console.print(f"Files in {folder}: {name}.md, {name}.json, {name}.png", markup=False, highlight=False)
