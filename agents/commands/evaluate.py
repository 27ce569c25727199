"""The command `hybridtrack evaluate`: metrics of deciders, nominal or under distribution shift."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro
from rich.console import Console

from agents.evaluation.registry import (
    ErrorArguments,
    distinct_titles,
    find_decider,
    given_threshold,
)
from agents.evaluation.shifts import differences_json, evaluate_shifts, shift_table
from agents.evaluation.task import Task, sweep
from agents.evaluation.tasks import task_of
from agents.evaluation.worlds import NOMINAL, draw_worlds
from agents.interface.help_texts import shown_default
from agents.interface.output_files import finite, write_json
from agents.interface.parallel import ParallelArguments
from agents.interface.progress import progress_display, shown
from agents.interface.world_arguments import TrustArguments, WorldArguments
from baselines.rules import seeds
from baselines.rules.decider import ANNOUNCED
from hybrid_env.checks import Count, NotNegative, reject
from hybrid_env.noises import parse_noise
from hybrid_env.rendering.evidence import mode_name


@dataclass(kw_only=True)
class Evaluate(WorldArguments, ErrorArguments, TrustArguments, ParallelArguments):
    """Evaluate deciders: accuracy, decision time, reward, tracking error, confusion matrix.

    With --env HybridTrackQuickest-v0: share of right ticks, delay, missed switches, wrong changes,
    reward.
    """

    deciders: Annotated[
        tyro.conf.Positional[tuple[str, ...]],
        shown_default("ate; threshold in HybridTrackQuickest-v0"),
    ] = ()
    """Rules, 'shipped', run folders, policies of other libraries or rules of your own, with
    optional thresholds: 'ate:1e-6', 'fixed:30', 'runs/ppo:-2', 'model.zip', 'policy.onnx',
    'mine.py:MyRule:0.1'. Announced switches: {announced}. Unknown switches: {unknown}.
    """
    episodes: Count = 1000
    """Number of evaluation episodes."""
    seed: NotNegative = 0
    """Seed of the first episode; later episodes use consecutive seeds."""
    shifted: bool = False
    """Evaluate under distribution shift (noise, radii, segment lengths, speed, outliers; with
    unknown switches laws of the durations and orders of the modes), at the thresholds with the best
    reward on as many other episodes, at most 1,000, of each environment and of the nominal one. The
    names then take no thresholds.
    """
    drawn: NotNegative = 0
    """Evaluate in this many random environments, from ranges twice as wide at both ends as in the
    training of the shipped agent, and in the nominal one, as with --shifted.
    """
    noises: tuple[str, ...] = ()
    """Evaluate under these laws of noise, and in the nominal environment, as with --shifted."""
    out: Annotated[Path | None, shown_default("none is written")] = None
    """JSON file for the metrics."""

    def run(self) -> None:
        """Evaluate the deciders and print the tables."""
        self._check()
        console = Console(emoji=False)
        first = task_of(*self.world_of(self.deciders[0] if self.deciders else ""))
        deciders = tuple(map(self.at_error, self.deciders or (first.reference,)))
        metrics = (
            self._evaluate_worlds(deciders, first, console)
            if self._worlds
            else self._evaluate(deciders, console)
        )
        if self.out is not None:
            write_json(self.out, metrics)
            print(f"Data {self.out}")

    @property
    def _worlds(self) -> bool:
        return bool(self.shifted or self.drawn or self.noises)

    def _check(self) -> None:
        # Checks --jobs and --engine also where one evaluation needs neither.
        self.workers()
        if self.out is not None and not self.out.parent.is_dir():
            raise reject("out", str(self.out), "a file in a folder that exists")
        if len(set(self.deciders)) != len(self.deciders):
            raise reject("deciders", self.deciders, "different names")
        if not self._worlds:
            return
        worlds = "with --shifted, --drawn or --noises"
        if self.seed + self.episodes > seeds.SELECTION:
            raise reject(
                "seed",
                self.seed,
                f"at most {seeds.SELECTION} minus the number of episodes, {worlds}",
            )
        for name in self.deciders:
            if given_threshold(name) is not None:
                raise reject("deciders", name, f"a name without a threshold, {worlds}")

    def _evaluate(self, deciders: tuple[str, ...], console: Console) -> Any:
        """Evaluate deciders at one threshold each; those of one environment are compared in one
        table.
        """
        # PyTorch.
        from agents.commands.tables import confusion_table, scores_table

        pairs = []
        # Checks all names before evaluating.
        for name in deciders:
            task = task_of(*self.world_of(name))
            decider = find_decider(name, task.options)
            task.options_with(decider.options)
            pairs.append((task, decider))
        titles = distinct_titles(deciders, [decider.title for _, decider in pairs])
        groups: dict[str, list[Any]] = {}
        rows: list[dict[str, Any]] = []
        with progress_display(console) as progress:
            bar = progress.add_task("Evaluating", total=len(pairs), note="")
            for name, title, (task, decider) in zip(deciders, titles, pairs, strict=True):
                progress.update(bar, note=name)
                scores = sweep(
                    task,
                    decider.changed(title=title),
                    self.episodes,
                    self.seed,
                    lambda share: progress.update(bar, completed=len(rows) + share),
                    (decider.threshold,),
                )
                figures = task.figures(scores)
                groups.setdefault(f"{task.env_id} {task.given}", []).append((task, scores, figures))
                row: dict[str, Any] = {
                    "decider": name,
                    "name": scores.name,
                    "threshold": {"symbol": scores.symbol, "value": decider.threshold},
                    "episodes": self.episodes,
                    "size": task.size(self.episodes),
                    **figures,
                }
                rows.append(row | {key: finite(values[0]) for key, values in scores.extra.items()})
            progress.update(bar, note="")
        for (task, first, figures), *others in groups.values():
            goal = task.statistic(task.goal)
            cells = [(first, figures, None)]
            cells += [
                (scores, estimates, scores.difference(first, goal))
                for _, scores, estimates in others
            ]
            console.print(
                scores_table(
                    task,
                    cells,
                    f"{task.title}: {task.size(self.episodes)}",
                    to=first.name,
                )
            )
            modes = [mode_name(mode, task.options.radii) for mode in range(task.options.hypotheses)]
            for scores, *_ in cells:
                # A larger matrix does not fit into a terminal.
                if "confusion" in scores.extra and len(modes) <= 5:
                    console.print(confusion_table(scores, modes))
        return rows

    def _evaluate_worlds(self, deciders: tuple[str, ...], task: Task, console: Console) -> Any:
        """Evaluate deciders in shifted, random or noisy environments and in the nominal one."""
        if self.drawn and task.switches != ANNOUNCED:
            raise reject("drawn", self.drawn, f"no value in {task.title}")
        worlds = task.shifted() if self.shifted else {NOMINAL: {}}
        worlds |= {str(parse_noise(noise, "noises")): {"noise": noise} for noise in self.noises}
        if self.drawn:
            worlds |= draw_worlds(self.drawn, seeds.DRAWN_WORLDS)
        for name in deciders:
            find_decider(name, task.options)
        tasks = {name: task.changed(changes) for name, changes in worlds.items()}
        results = shown(
            console,
            "Evaluating",
            len(deciders) * len(worlds),
            lambda note: evaluate_shifts(
                deciders,
                tasks,
                self.episodes,
                self.seed,
                self.workers(),
                note,
            ),
        )
        console.print(
            shift_table(
                results,
                f"{task.title} under distribution shift: {task.size(self.episodes)} each",
            )
        )
        data: dict[str, Any] = {"results": results}
        if len(deciders) > 1:
            data["differences"] = differences_json(results)
        return data | {"worlds": worlds}
