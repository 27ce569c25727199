"""Comparison of deciders: training where requested, selection of thresholds, scores on common
episodes.
"""

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from rich.progress import Progress

from agents.commands.continuation import Continuation, Plan, content_digest
from agents.evaluation.curves import comparison_figure
from agents.evaluation.registry import find_decider, is_external
from agents.evaluation.task import Levels, OnProgress, Selected, Task, sweep
from agents.figures.decider_colours import name_without_seed
from agents.interface.output_files import finite
from agents.interface.parallel import Call, Workers
from agents.interface.progress import train_shown
from baselines.rules import seeds
from baselines.rules.decider import Decider
from baselines.scoring.estimates import Estimate
from baselines.scoring.scores import Scores


@dataclass(frozen=True, eq=False)
class Entry(Selected):
    """Results of one decider on the reported episodes."""

    # Its name in the plan.
    decider: str
    # The goal of the task at that threshold, on the selection episodes.
    selected: float
    # Run folder of an agent that was trained.
    folder: Path | None = None

    @property
    def name(self) -> str:
        """Name in tables and figures."""
        return self.scores.name

    def found(self, task: Task) -> Decider:
        """Return the decider."""
        return find_decider(self.decider if self.folder is None else str(self.folder), task.options)

    @property
    def threshold(self) -> float:
        """The selected threshold."""
        return self.scores.thresholds[self.chosen]


@dataclass(frozen=True, eq=False)
class Comparison:
    """Result of a comparison."""

    # Settings.
    plan: Plan
    # Results of the deciders so far; the first is the reference.
    entries: Sequence[Entry]

    @cached_property
    def levels(self) -> Levels:
        """Figures of whole operating curves, see `Task.levels`; none without curves."""
        task, first = self.plan.task, self.entries[0]
        return task.levels(first.scores, first.found(task).default) if self.plan.curves else {}

    @property
    def best_rule(self) -> Entry:
        """The classical rule that is best for the goal on the selection episodes."""
        names = self.plan.deciders
        return max(
            (entry for entry in self.entries if entry.decider in names),
            key=lambda entry: entry.selected,
        )

    @property
    def seed_groups(self) -> dict[str, list[Entry]]:
        """Entries by name; agents whose names differ only in the training seed form one group."""
        groups: dict[tuple[str, str, int], list[Entry]] = {}
        for entry in self.entries:
            is_agent = entry.decider in self.plan.agents and not is_external(entry.decider)
            name = name_without_seed(entry.name) if is_agent else entry.name
            key = name, entry.scores.symbol, len(entry.scores.thresholds)
            groups.setdefault(key, []).append(entry)
        names = {entry.name for entry in self.entries}
        labels = [f"{name} seeds" if name in names else name for name, *_ in groups]
        parts = zip(labels, groups.values(), strict=True)
        return {
            entries[0].name if len(entries) == 1 else label: entries for label, entries in parts
        }

    @functools.cache  # noqa: B019
    def figures(self, entry: Entry) -> dict[str, Estimate]:
        """Return the metrics of a decider at its selected threshold, by name."""
        return self.plan.task.figures(entry.scores, entry.chosen)

    @functools.cache  # noqa: B019
    def at_levels(self, entry: Entry) -> dict[tuple[str, ...], Estimate]:
        """Return the figures of a whole operating curve, by their keys in `levels`."""
        return {
            keys: entry.scores.estimate(metric.statistic) for keys, metric in self.levels.items()
        }

    def to_best_rule(self, entry: Entry) -> Estimate | None:
        """Return the paired difference of the goal to that of the best rule; None for this rule."""
        best, task = self.best_rule, self.plan.task
        if entry is best:
            return None
        goal = task.statistic(task.goal)
        return entry.scores.difference(best.scores, goal, entry.chosen, best.chosen)

    @functools.cache  # noqa: B019
    def against(self, entry: Entry) -> dict[str, Estimate]:
        """Return the paired figures of a decider and the reference, see `Task.against`; none of
        the reference.
        """
        reference = self.entries[0]
        if entry is reference:
            return {}
        return self.plan.task.against(entry, reference, self.plan.curves)

    def picture(self) -> Figure:
        """Return the figure of the operating curves."""
        return comparison_figure(self.plan.task, self.seed_groups)

    def largest_difference(self) -> tuple[Entry, int]:
        """The best agent, or without one the best rule, and the episode in which it differs most
        from the reference.
        """
        agents = [entry for entry in self.entries if entry.decider in self.plan.agents]
        best = max(agents, key=lambda entry: entry.selected) if agents else self.best_rule
        mine, other = (
            entry.scores.of(self.plan.task.goal, entry.chosen) for entry in (best, self.entries[0])
        )
        return best, int(np.abs(mine - other).argmax())

    def as_json(self) -> dict[str, Any]:
        """Contents of tables and figures, with every point of the curves."""
        return {
            "plan": self.plan.settings,
            "selection": {"seed": seeds.SELECTION, "episodes": self.plan.selection_episodes},
            "best_rule": self.best_rule.name,
            "deciders": [self._entry_json(entry) for entry in self.entries],
        }

    def _entry_json(self, entry: Entry) -> dict[str, Any]:
        task, scores, difference = self.plan.task, entry.scores, self.to_best_rule(entry)
        levels: dict[str, Any] = {}
        for (*outer, last), estimate in self.at_levels(entry).items():
            place = levels.setdefault(outer[0], {}) if outer else levels
            place[last] = estimate.as_json()
        against = _plain(self.against(entry))
        return {
            "name": entry.name,
            "threshold": {"symbol": scores.symbol, "chosen": entry.threshold},
            **_plain(self.figures(entry)),
            **{name: finite(values[entry.chosen]) for name, values in scores.extra.items()},
            **{
                metric.name: finite(scores.curve(metric.statistic)[entry.chosen])
                for metric in task.further
            },
            "reward_less_best_rule": None if difference is None else difference.as_json(),
            **levels,
            **({task.paired: against} if against else {}),
            "curve": {"thresholds": list(scores.thresholds)}
            | {metric.name: finite(scores.curve(metric.statistic)) for metric in task.metrics},
        }


def _plain(estimates: Mapping[str, Estimate]) -> dict[str, Any]:
    return {name: estimate.as_json() for name, estimate in estimates.items()}


def compare(
    plan: Plan,
    workers: Workers,
    progress: Progress,
    folder: Path | None,
    on_entry: Callable[[Comparison], None] = lambda now: None,
) -> Comparison:
    """Train and score the deciders of a plan.

    The folder keeps trained agents and, until the comparison is complete, the scores of each
    decider: one that was interrupted goes on from there, with the same results. `on_entry` is
    called after each decider.
    """
    shown = None if workers.parallel else progress
    planned = plan.calls()
    calls: dict[tuple[str, int], Call] = {
        call: functools.partial(score, plan, folder, *call, call == planned[0], shown)
        for call in planned
    }
    if workers.parallel:
        # Training takes longest: it begins first, so that no process waits for it at the end.
        rules_last = sorted(
            calls,
            key=lambda call: isinstance(plan.find(call[0]), Decider),
        )
        calls = {call: calls[call] for call in rules_last}
    task = progress.add_task("Comparing", total=len(calls), note="")
    scored: dict[tuple[str, int], Entry] = {}
    entries: list[Entry] = []
    result = Comparison(plan, entries)
    for call, entry in workers.results(
        calls,
        lambda call: progress.update(task, advance=1, note=call[0]),
    ):
        scored[call] = entry
        entries[:] = [scored[name] for name in planned if name in scored]
        if planned[0] in scored:
            on_entry(result)
    progress.update(task, note="")
    Continuation(plan.settings, folder).finish()
    return result


def score(
    plan: Plan,
    folder: Path | None,
    name: str,
    number: int,
    full: bool,
    progress: Progress | None,
) -> Entry:
    """Train a decider if needed, select its threshold and score it, unless its file exists.

    `number` is its training seed. `full`: also score thresholds that are not selected, if the plan
    has no curves.
    """
    display = Progress(disable=True) if progress is None else progress
    continuation = Continuation(plan.settings, folder)
    decider = plan.find(name)
    run_folder = None
    title = plan.titles[name]
    if not isinstance(decider, Decider):
        decider, run_folder = train_agent(decider, plan, number, display, continuation)
        title += f" seed {number}" if plan.training_seeds > 1 else ""
    content = content_digest(name if run_folder is None else str(run_folder), plan.task.switches)
    decider = decider.changed(title=title)
    # Other code may have the same name the next time.
    if content is None:
        continuation = Continuation(plan.settings, None)
    key = [decider.title, decider.thresholds, decider.options, content, full]
    saved = continuation.load(key)
    if saved is None:
        bar = display.add_task("Scoring", total=2.0, note=decider.title)
        saved = _score(decider, plan, full, lambda done: display.update(bar, completed=done))
        continuation.save(key, *saved)
        display.remove_task(bar)
    scores, chosen, selected = saved
    return Entry(scores, chosen, name, selected, run_folder)


def _score(
    decider: Decider,
    plan: Plan,
    full: bool,
    on_progress: OnProgress,
) -> tuple[Scores, int, float]:
    """Return scores on the reported episodes, the index of the selected threshold, and its goal
    before.
    """
    task = plan.task
    selection = sweep(task, decider, plan.selection_episodes, seeds.SELECTION, on_progress)
    index = task.best(selection) if plan.accuracy is None else fastest(selection, plan.accuracy)
    selected = float(selection.curve(task.statistic(task.goal))[index])
    if not (plan.curves or full):
        decider, index = decider.changed(thresholds=(decider.thresholds[index],)), 0
    scores = sweep(task, decider, plan.episodes, plan.seed, lambda share: on_progress(1.0 + share))
    return scores, index, selected


def fastest(scores: Scores, accuracy: float) -> int:
    """Return the index of the fastest threshold at a required accuracy; if none reaches it, the
    most accurate one.
    """
    means = dict(zip(scores.columns, scores.values.mean(0), strict=True))
    reached = means["accuracy"] >= accuracy
    best = (
        np.where(reached, means["ticks"], np.inf).argmin()
        if reached.any()
        else means["accuracy"].argmax()
    )
    return int(best)


def train_agent(
    recipe: Any,
    plan: Plan,
    number: int,
    progress: Progress,
    continuation: Continuation,
) -> tuple[Decider, Path | None]:
    """Train an agent, or go on with its training; return it and its run folder."""
    from agents.training.checkpoint import has_checkpoint
    from agents.training.runs import make_run

    name = recipe.name if plan.training_seeds == 1 else f"{recipe.name} seed {number}"
    folder = continuation.run_folder(recipe.name, recipe.as_json(), number)
    resume = folder is not None and has_checkpoint(folder)
    run = make_run(
        plan.task.env_id,
        dict(plan.task.given),
        recipe,
        number,
        folder,
        plan.steps,
        resume,
    )
    train_shown(run, progress, f"Training {name}")
    return run.agent(name), folder
