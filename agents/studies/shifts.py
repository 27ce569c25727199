"""Deciders in environments other than the nominal one: one study for shifted and random environments."""

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rich.table import Table
from rich.text import Text

from agents.evaluation.cells import new_table
from agents.evaluation.registry import find_family
from agents.evaluation.task import Task, sweep
from agents.evaluation.tasks import task_of
from agents.evaluation.worlds import NOMINAL
from agents.interface.parallel import Workers
from baselines.rules import seeds
from baselines.rules.msprt import ALPHAS, FEW_ALPHAS
from baselines.scoring.estimates import Estimate
from baselines.scoring.scores import Scores

MOST_THRESHOLDS = 13
"""Thresholds tried in each environment, spread over those of the decider; all posteriors use `FEW_ALPHAS`."""


@dataclass(frozen=True, eq=False)
class Shift:
    """Scores of one decider in one environment.

    Attributes:
        world: name of the environment.
        task: what is decided, in this environment.
        own: scores at the threshold selected in this environment, on other episodes.
        nominal: scores at the threshold selected in the nominal environment.
    """

    world: str
    task: Task
    own: Scores
    nominal: Scores

    @property
    def decider(self) -> str:
        """Name of the decider."""
        return self.own.name

    @property
    def reward(self) -> Estimate:
        """Mean of the goal at the own threshold."""
        return self.own.estimate(self.task.statistic(self.task.goal))

    @property
    def nominal_reward(self) -> Estimate:
        """Mean of the goal at the threshold of the nominal environment."""
        return self.nominal.estimate(self.task.statistic(self.task.goal))

    def less(self, other: "Shift") -> tuple[Estimate, float]:
        """Return the goal less that of another decider, and the same at the nominal threshold of this one."""
        goal = self.task.statistic(self.task.goal)
        return self.own.difference(other.own, goal), self.nominal.difference(other.own, goal).value

    def as_json(self) -> dict[str, Any]:
        """Return the figures."""
        metrics = {
            metric.name: float(self.own.curve(metric.statistic)[0])
            for metric in self.task.metrics
            if metric.name != self.task.goal
        }
        reward, nominal = self.reward, self.nominal_reward
        return {
            "world": self.world, "decider": self.decider, "threshold": self.own.thresholds[0],
            "reward": reward.value, "low": reward.low, "high": reward.high, **metrics,
            "nominal_threshold": self.nominal.thresholds[0], "nominal_reward": nominal.value,
            "nominal_low": nominal.low, "nominal_high": nominal.high,
        }  # fmt: skip


def evaluate_shifts(
    names: Sequence[str],
    nominal: Task,
    worlds: Mapping[str, dict[str, Any]],
    episodes: int,
    seed: int,
    workers: Workers,
    on_progress: Callable[[str], None],
) -> list[Shift]:
    """Evaluate every decider in every environment.

    Each decider uses the threshold with the best reward, selected on other episodes, once of the same
    environment and once of the nominal environment. Rules that are fitted to an environment are fitted to
    each of them.

    Args:
        names: of deciders, without thresholds.
        nominal: what is decided, in the nominal environment.
        worlds: name and changed options of the environments, the nominal one first.
        episodes: number of evaluation episodes.
        seed: of the first episode.
        workers: where the evaluations run.
        on_progress: called with the name of the decider and environment that were evaluated.
    """
    alone = functools.partial(evaluate_world, nominal=nominal, episodes=episodes, seed=seed)
    calls = {
        f"{name}: {NOMINAL}": functools.partial(alone, name, NOMINAL, worlds.get(NOMINAL, {}), None) for name in names
    }
    found = dict(workers.results(calls, on_progress))  # their thresholds are those of the other environments
    others = {
        f"{name}: {world}": functools.partial(
            alone, name, world, changes, found[f"{name}: {NOMINAL}"].own.thresholds[0]
        )
        for name in names
        for world, changes in worlds.items()
        if world != NOMINAL
    }
    found |= workers.results(others, on_progress)
    return [found[f"{name}: {world}"] for name in names for world in worlds]


def evaluate_world(
    name: str, world: str, changes: dict[str, Any], threshold: float | None, nominal: Task, episodes: int, seed: int
) -> Shift:
    """Evaluate a decider in one environment; without a nominal threshold, it also serves as nominal.

    Arguments as in `evaluate_shifts`.
    """
    task = task_of(nominal.env_id, {**nominal.given, **changes})
    family = find_family(name, task.options)
    thresholds = FEW_ALPHAS if family.thresholds == ALPHAS else family.thresholds
    thresholds = thresholds[:: -(-len(thresholds) // MOST_THRESHOLDS)]
    count = min(episodes, seeds.SELECTION_EPISODES)
    best = thresholds[task.best(sweep(task, family, count, seeds.SELECTION, thresholds=thresholds))]
    own = sweep(task, family, episodes, seed, thresholds=(best,))
    if threshold in (None, best):
        return Shift(world, task, own, own)
    return Shift(world, task, own, sweep(task, family, episodes, seed, thresholds=(threshold,)))


def differences(results: Sequence[Shift]) -> dict[str, tuple[Shift, Estimate, float]]:
    """Return the best other decider in each environment, and the first less that one, see `Shift.less`."""
    found = {}
    for world in dict.fromkeys(result.world for result in results):
        mine, *others = (result for result in results if result.world == world)
        best = max(others, key=lambda one: one.reward.value)
        found[world] = best, *mine.less(best)
    return found


def differences_json(results: Sequence[Shift]) -> list[dict[str, Any]]:
    """Return `differences` as plain values."""
    return [
        {
            "world": world, "decider": results[0].decider, "other": best.decider, "difference": gain.value,
            "low": gain.low, "high": gain.high, "nominal_difference": nominal,
        }
        for world, (best, gain, nominal) in differences(results).items()
    ]  # fmt: skip


def shift_table(results: Sequence[Shift], title: str) -> Table:
    """Return a table with environments in rows and deciders in columns."""
    deciders = list(dict.fromkeys(result.decider for result in results))
    caption = (
        "Reward and half width of its 95 % confidence interval, at the threshold selected in this "
        "environment; in the last line of a row the reward at the threshold selected in the nominal "
        "environment."
    )
    gains = differences(results) if len(deciders) > 1 else {}
    if gains:
        caption += " The last column compares the same episodes."
    table = new_table(title, caption)
    table.padding, table.show_edge = (0, 0, 0, 0), False
    table.add_column("environment", min_width=14)
    heads = [name.replace(" ", "\n") for name in deciders] + [f"{deciders[0]} -\nbest\nother"] * bool(gains)
    for head in heads:
        table.add_column(Text(head), justify="right", no_wrap=True)
    for world in dict.fromkeys(result.world for result in results):
        row = {result.decider: result for result in results if result.world == world}
        cells = [_cell(world, row[name].reward, row[name].nominal_reward.value) for name in deciders]
        if world in gains:
            cells.append(_cell(world, *gains[world][1:]))
        table.add_row(world, *cells)
    return table


def _cell(world: str, estimate: Estimate, nominal: float) -> str:
    """Return three short lines, so that six deciders fit into 80 columns."""
    lines = [f"{estimate.value:+.3f}", f"±{(estimate.high - estimate.low) / 2:.3f}"]
    return "\n".join(lines if world == NOMINAL else [*lines, f"[bright_black]{nominal:+.3f}[/]"])
