"""The command `hybridtrack evaluate`: metrics of deciders on the same episodes."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console

from agents.evaluation.registry import (
    ErrorArguments,
    check_name,
    distinct_titles,
    find_decider,
    parse_name,
)
from agents.evaluation.report import Result, result_tables
from agents.evaluation.task import sweep, task_of
from agents.interface.help_texts import shown_default
from agents.interface.output_files import write_json
from agents.interface.progress import progress_display
from agents.interface.world_arguments import TrustArguments, WorldArguments
from hybrid_env.checks import Count, NotNegative, reject


@dataclass(kw_only=True)
class Evaluate(WorldArguments, ErrorArguments, TrustArguments):
    """Evaluate deciders: accuracy, decision time, reward, tracking error.

    With --env HybridTrackQuickest-v0: share of right ticks, delay, missed switches, wrong changes,
    reward.
    """

    deciders: Annotated[
        tyro.conf.Positional[tuple[str, ...]],
        tyro.conf.arg(metavar="[DECIDER ...]"),
        shown_default("ate; threshold in HybridTrackQuickest-v0"),
    ] = ()
    """Rules, 'shipped', run folders, policies of other libraries or rules of your own, with
    optional thresholds: 'ate:1e-6', 'fixed:30', 'runs/ppo:-2', 'model.zip',
    'mine.py:MyRule:0.1'. Announced switches: {announced}. Unknown switches: {unknown}.
    """
    episodes: Count = 1000
    """Number of evaluation episodes."""
    seed: NotNegative = 0
    """Seed of the first episode; later episodes use consecutive seeds."""
    confusion: bool = False
    """Also print how often each mode was decided where each was true; not for unknown switches."""
    out: Annotated[Path | None, shown_default("none is written")] = None
    """JSON file for the metrics, with the confusion matrices."""

    def run(self) -> None:
        """Evaluate the deciders at one threshold each, and print the tables."""
        if self.out is not None and not self.out.parent.is_dir():
            raise reject("out", str(self.out), "a file in a folder that exists")
        console = Console(emoji=False)
        results = self._evaluate(console)
        for table in result_tables(results, self.confusion):
            console.print(table)
        if self.out is not None:
            rows = [
                {
                    "decider": result.decider,
                    "episodes": self.episodes,
                    "size": result.task.size(self.episodes),
                    **result.as_json(),
                }
                for result in results
            ]
            write_json(self.out, rows)
            print(f"Data {self.out}")

    def _evaluate(self, console: Console) -> list[Result]:
        tasks = [task_of(*self.world_of(name)) for name in self.deciders or ("",)]
        names = self.deciders or (tasks[0].reference,)
        for name, task in zip(names, tasks, strict=True):
            check_name(name, task.switches)
        results: list[Result] = []
        with progress_display(console) as progress:
            bar = progress.add_task("Loading", total=len(names), note="")
            # All are loaded before any is evaluated.
            deciders = [
                find_decider(self.at_error(name), task.options)
                for name, task in zip(names, tasks, strict=True)
            ]
            titles = distinct_titles(names, [decider.title for decider in deciders])
            for name, title, task, decider in zip(names, titles, tasks, deciders, strict=True):
                if parse_name(self.at_error(name)).chosen:
                    progress.update(bar, description=f"Choosing the threshold of {title}")
                    # The decider remembers what it has chosen.
                    decider.at(decider.threshold)
                progress.update(bar, description=f"Evaluating {title}")
                scores = sweep(
                    task,
                    decider.changed(title=title),
                    self.episodes,
                    self.seed,
                    lambda share: progress.update(bar, completed=len(results) + share),
                    (decider.threshold,),
                )
                results.append(Result(task, scores, decider=name))
        return results
