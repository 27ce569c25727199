"""Deciders in environments other than the nominal one: one study for shifted and random
environments.
"""

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

from rich.markup import escape
from rich.table import Table

from agents.evaluation.cells import filled_table
from agents.evaluation.registry import distinct_titles, find_family
from agents.evaluation.selection import select_threshold
from agents.evaluation.task import Task, sweep
from agents.evaluation.worlds import NOMINAL
from agents.interface.parallel import Workers
from baselines.scoring.estimates import Estimate
from baselines.scoring.scores import Scores


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
        }


def evaluate_shifts(
    names: Sequence[str],
    worlds: Mapping[str, Task],
    episodes: int,
    seed: int,
    workers: Workers,
    on_progress: Callable[[str], None],
) -> list[Shift]:
    """Evaluate every decider in every environment, the nominal one among them; `on_progress` is
    called with the name of both.

    Each decider uses the threshold with the best reward, selected on other episodes, once of the
    same environment and once of the nominal environment. Rules that are fitted to an environment
    are fitted to each of them.
    """
    alone = functools.partial(evaluate_world, episodes=episodes, seed=seed)
    home = worlds[NOMINAL]
    calls = {
        f"{name}: {NOMINAL}": functools.partial(alone, name, NOMINAL, home, None) for name in names
    }
    results = dict(workers.results(calls, on_progress))
    others = {}
    for name, (world, task) in product(names, worlds.items()):
        if world != NOMINAL:
            usual = results[f"{name}: {NOMINAL}"].own.thresholds[0]
            others[f"{name}: {world}"] = functools.partial(alone, name, world, task, usual)
    results |= workers.results(others, on_progress)
    titles = distinct_titles(names, [find_family(name, home.options).name for name in names])
    pairs = zip(names, titles, strict=True)
    return [results[f"{name}: {world}"].called(title) for name, title in pairs for world in worlds]


def evaluate_world(
    name: str,
    world: str,
    task: Task,
    threshold: float | None,
    episodes: int,
    seed: int,
) -> Shift:
    """Evaluate a decider in one environment; without a nominal threshold, its own also serves as
    nominal.
    """
    family = find_family(name, task.options)
    best = select_threshold(task, family, episodes)
    own = sweep(task, family, episodes, seed, thresholds=(best,))
    if threshold in (None, best):
        return Shift(world, task, own, own)
    return Shift(world, task, own, sweep(task, family, episodes, seed, thresholds=(threshold,)))


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
