"""Deciders in environments other than the nominal one: one study for shifted and random
environments.
"""

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rich.markup import escape
from rich.table import Table

from agents.evaluation.cells import filled_table
from agents.evaluation.registry import distinct_titles, find_decider
from agents.evaluation.selection import select_threshold
from agents.evaluation.task import Task, sweep
from agents.evaluation.worlds import NOMINAL
from agents.interface.parallel import Workers
from baselines.scoring.estimates import Estimate
from baselines.scoring.scores import Scores


@dataclass(frozen=True, eq=False)
class Shift:
    """Scores of one decider in one environment, at two thresholds."""

    # Name of the environment.
    world: str
    # What is decided, in this environment.
    task: Task
    # First at the threshold selected in this environment, last at that of the nominal one, on other
    # episodes.
    scores: Scores

    def reward(self, index: int) -> Estimate:
        """Return the mean of the goal at the first or the last threshold."""
        return self.scores.estimate(self.task.statistic(self.task.goal), index)

    def as_json(self) -> dict[str, Any]:
        """Return the figures."""
        first, thresholds = self.scores.at(0), self.scores.thresholds
        others = [metric for metric in self.task.metrics if metric.name != self.task.goal]
        return {
            "world": self.world,
            "decider": self.scores.name,
            "threshold": thresholds[0],
            **_bounds(self.reward(0), "", "reward"),
            **{metric.name: float(first.curve(metric.statistic)[0]) for metric in others},
            "nominal_threshold": thresholds[-1],
            **_bounds(self.reward(-1), "nominal_", "reward"),
        }


def _bounds(estimate: Estimate, prefix: str, name: str) -> dict[str, float]:
    """Return an estimate with its interval as plain values."""
    keys = (prefix + name, f"{prefix}low", f"{prefix}high")
    return dict(zip(keys, (estimate.value, estimate.low, estimate.high), strict=True))


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
    home = worlds[NOMINAL]
    deciders = {name: find_decider(name, home.options) for name in names}
    titles = distinct_titles(names, [decider.title for decider in deciders.values()])
    usual = dict(
        workers.results(
            {
                name: functools.partial(select_threshold, home, decider, episodes)
                for name, decider in deciders.items()
            }
        )
    )
    calls = {
        f"{title}: {world}": functools.partial(
            evaluate_world, name, title, world, task, usual[name], episodes, seed
        )
        for name, title in zip(names, titles, strict=True)
        for world, task in worlds.items()
    }
    return [result for _, result in workers.results(calls, on_progress)]


def evaluate_world(
    name: str,
    title: str,
    world: str,
    task: Task,
    usual: float,
    episodes: int,
    seed: int,
) -> Shift:
    """Evaluate a decider in one environment, at the threshold selected there and at its usual
    one.
    """
    decider = find_decider(name, task.options).changed(title=title)
    best = usual if world == NOMINAL else select_threshold(task, decider, episodes)
    thresholds = tuple(dict.fromkeys((best, usual)))
    return Shift(world, task, sweep(task, decider, episodes, seed, thresholds=thresholds))


def differences(results: Sequence[Shift]) -> dict[str, tuple[Shift, Estimate, Estimate]]:
    """Return the best other decider of each environment, and the first less it, also at the
    nominal threshold.
    """
    gains = {}
    for world in dict.fromkeys(result.world for result in results):
        mine, *others = (result for result in results if result.world == world)
        best = max(others, key=lambda other: other.reward(0).value)
        goal = mine.task.statistic(mine.task.goal)
        gain, nominal = (mine.scores.difference(best.scores, goal, index, 0) for index in (0, -1))
        gains[world] = best, gain, nominal
    return gains


def differences_json(results: Sequence[Shift]) -> list[dict[str, Any]]:
    """Return `differences` as plain values."""
    return [
        {
            "world": world,
            "decider": results[0].scores.name,
            "other": best.scores.name,
            **_bounds(gain, "", "difference"),
            **_bounds(nominal, "nominal_", "difference"),
        }
        for world, (best, gain, nominal) in differences(results).items()
    ]


def shift_table(results: Sequence[Shift], title: str) -> Table:
    """Return a table with environments in rows and deciders in columns."""
    deciders = list(dict.fromkeys(result.scores.name for result in results))
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
        row = {result.scores.name: result for result in results if result.world == world}
        pairs = [(row[name].reward(0), row[name].reward(-1)) for name in deciders]
        pairs += [gains[world][1:]] if gains else []
        rows.append((world, *(_cell(world, reward, nominal.value) for reward, nominal in pairs)))
    table = filled_table(title, ("environment   ", *heads), rows, caption)
    table.padding, table.show_edge = (0, 0, 0, 0), False
    return table


def _cell(world: str, estimate: Estimate, nominal: float) -> str:
    """Return three short lines, so that six deciders fit into 80 columns."""
    lines = [f"{estimate.value:+.3f}", f"±{(estimate.high - estimate.low) / 2:.3f}"]
    return "\n".join(lines if world == NOMINAL else [*lines, f"[bright_black]{nominal:+.3f}[/]"])
