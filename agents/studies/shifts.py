"""Deciders in environments other than the nominal one: one study for shifted and random
environments.
"""

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any

from rich.markup import escape
from rich.table import Table

from agents.evaluation.cells import filled_table
from agents.evaluation.registry import distinct_titles, find_family
from agents.evaluation.task import Task, sweep
from agents.evaluation.worlds import NOMINAL
from agents.interface.parallel import Workers
from baselines.rules import seeds
from baselines.rules.msprt import ALPHAS, FEW_ALPHAS
from baselines.scoring.estimates import Estimate
from baselines.scoring.scores import Scores

# Tried in each environment, spread over those of the decider; posteriors use `FEW_ALPHAS`.
MOST_THRESHOLDS = 13


@dataclass(frozen=True, eq=False)
class Shift:
    """Scores of one decider in one environment."""

    # Name of the environment.
    world: str
    # What is decided, in this environment.
    task: Task
    # Scores at the threshold selected in this environment, on other episodes.
    own: Scores
    # Scores at the threshold selected in the nominal environment.
    nominal: Scores
    # Options that were selected with the own threshold, see `Task.settings`.
    setting: Mapping[str, Any] = field(default_factory=dict)

    @property
    def decider(self) -> str:
        """Name of the decider."""
        return self.own.name

    def called(self, title: str) -> "Shift":
        """Return the scores under another name of the decider."""
        own, nominal = replace(self.own, name=title), replace(self.nominal, name=title)
        return replace(self, own=own, nominal=nominal)

    @property
    def reward(self) -> Estimate:
        """Mean of the goal at the own threshold."""
        return self.own.estimate(self.task.statistic(self.task.goal))

    @property
    def nominal_reward(self) -> Estimate:
        """Mean of the goal at the threshold of the nominal environment."""
        return self.nominal.estimate(self.task.statistic(self.task.goal))

    def as_json(self) -> dict[str, Any]:
        """Return the figures."""
        others = [metric for metric in self.task.metrics if metric.name != self.task.goal]
        reward, nominal = self.reward, self.nominal_reward
        return {
            "world": self.world,
            "decider": self.decider,
            "threshold": self.own.thresholds[0],
            "reward": reward.value,
            "low": reward.low,
            "high": reward.high,
            **{metric.name: float(self.own.curve(metric.statistic)[0]) for metric in others},
            "nominal_threshold": self.nominal.thresholds[0],
            "nominal_reward": nominal.value,
            "nominal_low": nominal.low,
            "nominal_high": nominal.high,
        } | ({"setting": dict(self.setting)} if self.setting else {})


def evaluate_shifts(
    names: Sequence[str],
    worlds: Mapping[str, Task],
    episodes: int,
    seed: int,
    workers: Workers,
    on_progress: Callable[[str], None],
    untuned: Sequence[str] = (),
) -> list[Shift]:
    """Evaluate every decider in every environment; `on_progress` is called with the name of both.

    Each decider uses the threshold with the best reward, selected on other episodes, once of the
    same environment and once of the nominal environment; without a nominal one, its default. Rules
    that are fitted to an environment are fitted to each of them. Nothing is selected for `untuned`
    names: their nominal threshold is also their own, with the changes `Task.untuned`.
    """
    alone = functools.partial(evaluate_world, episodes=episodes, seed=seed)
    home = worlds.get(NOMINAL)
    calls = {
        f"{name}: {NOMINAL}": functools.partial(alone, name, NOMINAL, home, None) for name in names
    }
    found = dict(workers.results(calls if home else {}, on_progress))
    others = {}
    for name, (world, task) in product(names, worlds.items()):
        if world != NOMINAL:
            at_home = found.get(f"{name}: {NOMINAL}")
            usual = (
                at_home.own.thresholds[0] if at_home else find_family(name, task.options).default
            )
            others[f"{name}: {world}"] = functools.partial(
                alone,
                name,
                world,
                task,
                usual,
                tuned=name not in untuned,
            )
    found |= workers.results(others, on_progress)
    options = next(iter(worlds.values())).options
    titles = distinct_titles(names, [find_family(name, options).name for name in names])
    pairs = zip(names, titles, strict=True)
    return [found[f"{name}: {world}"].called(title) for name, title in pairs for world in worlds]


def evaluate_world(
    name: str,
    world: str,
    task: Task,
    threshold: float | None,
    episodes: int,
    seed: int,
    tuned: bool = True,
) -> Shift:
    """Evaluate a decider in one environment; without a nominal threshold, its own also serves as
    nominal.
    """
    if threshold is not None:
        usual = sweep(
            task,
            find_family(name, task.options),
            episodes,
            seed,
            thresholds=(threshold,),
        )
        if not tuned:
            told = task.changed(task.untuned)
            alone = sweep(
                told,
                find_family(name, told.options),
                episodes,
                seed,
                thresholds=(threshold,),
            )
            return Shift(world, told, alone, usual, task.untuned)
    count = min(episodes, seeds.SELECTION_EPISODES)
    usual_family = find_family(name, task.options)
    tried = []
    observes = usual_family.make(usual_family.default).observes
    for setting in task.settings(observes):
        own = task.changed(setting)
        family = find_family(name, own.options)
        thresholds = FEW_ALPHAS if family.thresholds == ALPHAS else family.thresholds
        thresholds = thresholds[:: -(-len(thresholds) // MOST_THRESHOLDS)]
        scores = sweep(own, family, count, seeds.SELECTION, thresholds=thresholds)
        rewards = scores.curve(own.statistic(own.goal))
        tried.append((float(rewards.max()), thresholds[task.best(scores)], setting))
    _, best, setting = max(tried, key=lambda one: one[0])
    if threshold == best and not setting:
        return Shift(world, task, usual, usual)
    chosen = task.changed(setting)
    found = sweep(chosen, find_family(name, chosen.options), episodes, seed, thresholds=(best,))
    return Shift(world, chosen, found, found if threshold is None else usual, setting)


def differences(results: Sequence[Shift]) -> dict[str, tuple[Shift, Estimate, Estimate]]:
    """Return the best other decider of each environment, and the first less it, also at the
    nominal threshold.
    """
    found = {}
    for world in dict.fromkeys(result.world for result in results):
        mine, *others = (result for result in results if result.world == world)
        best = max(others, key=lambda one: one.reward.value)
        goal = mine.task.statistic(mine.task.goal)
        found[world] = (
            best,
            mine.own.difference(best.own, goal),
            mine.nominal.difference(best.own, goal),
        )
    return found


def differences_json(results: Sequence[Shift]) -> list[dict[str, Any]]:
    """Return `differences` as plain values."""
    return [
        {
            "world": world,
            "decider": results[0].decider,
            "other": best.decider,
            "difference": gain.value,
            "low": gain.low,
            "high": gain.high,
            "nominal_difference": nominal.value,
            "nominal_low": nominal.low,
            "nominal_high": nominal.high,
        }
        for world, (best, gain, nominal) in differences(results).items()
    ]


def shift_table(results: Sequence[Shift], title: str) -> Table:
    """Return a table with environments in rows and deciders in columns."""
    deciders = list(dict.fromkeys(result.decider for result in results))
    caption = (
        "Reward and half width of its 95 % confidence interval, at the threshold selected in this"
        " environment; in the last line of a row the reward at the threshold selected in the"
        " nominal environment, or without one at the default."
    )
    gains = differences(results) if len(deciders) > 1 else {}
    if gains:
        caption += " The last column compares the same episodes."
    heads = [escape(name).replace(" ", "\n") for name in deciders]
    heads += [f"{heads[0]} -\nbest\nother"] * bool(gains)
    rows = []
    for world in dict.fromkeys(result.world for result in results):
        row = {result.decider: result for result in results if result.world == world}
        pairs = [(row[name].reward, row[name].nominal_reward) for name in deciders]
        pairs += [gains[world][1:]] if gains else []
        rows.append((world, *(_cell(world, own, nominal.value) for own, nominal in pairs)))
    table = filled_table(title, ("environment   ", *heads), rows, caption)
    table.padding, table.show_edge = (0, 0, 0, 0), False
    return table


def _cell(world: str, estimate: Estimate, nominal: float) -> str:
    """Return three short lines, so that six deciders fit into 80 columns."""
    lines = [f"{estimate.value:+.3f}", f"±{(estimate.high - estimate.low) / 2:.3f}"]
    return "\n".join(lines if world == NOMINAL else [*lines, f"[bright_black]{nominal:+.3f}[/]"])
