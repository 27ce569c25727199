"""The command `hybridtrack limits`: what limits decisions, and how far each rule gets."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

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
    deciders: tuple[str, ...] = ()
    """Further deciders to evaluate on every filter bank with known switch moments, as 'mine.py:MyRule'."""
    episodes: int = 3000
    """Number of episodes per rule; a third as many others serve to select thresholds."""
    seed: int = 0
    """Seed of the first episode."""
    out: Path = Path("results")
    """Folder for limits.md, limits.json and limits.png."""

    def run(self) -> None:
        """Evaluate the rules, print the tables and write the files.

        Raises:
            ArgumentError: an argument is out of range, or the output folder cannot be written.
        """
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
        folder = output_folder("out", self.out)
        console = Console(emoji=False)
        by_part = calls("" if self.env is None else QUICKEST_ENV, self.episodes, self.seed, self.deciders)
        with progress_display(console) as progress:
            all_calls = {name: call for part in by_part.values() for name, call in part.items()}
            bar = progress.add_task("Evaluating", total=len(all_calls), note="")
            found = dict(workers.results(all_calls, lambda note: progress.update(bar, advance=1, note=note)))
            progress.update(bar, note="")
        parts = {part: [one for name in named for one in found[name]] for part, named in by_part.items()}
        text = limits_markdown(parts)
        console.print(Markdown(text))
        with atomic_file(folder / "limits.md") as part:
            part.write_text(text, encoding="utf-8")
        write_json(folder / "limits.json", limits_json(parts))
        save_figure(limits_figure(parts), folder / "limits.png")
        console.print(f"Files in {folder}: limits.md, limits.json, limits.png", markup=False, highlight=False)
