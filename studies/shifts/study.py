"""Deciders in several environments, at the best threshold of each and at the nominal one."""

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd
from joblib import delayed

from agents import Task, bound_scores, find_decider, select_threshold, sweep, task_of
from baselines import Estimate
from studies.results import in_brackets, in_parallel, markdown_table
from studies.shifts.worlds import NOMINAL, draw_worlds, shifted_worlds

# A row of the table, as in JSON: world, decider, thresholds, and rewards as `Estimate`.
Row = dict[str, Any]


def worlds_of(task: Task, shifted: bool, drawn: int) -> dict[str, dict[str, Any]]:
    """Return name and changed options of the environments, the nominal one first."""
    changed = shifted_worlds(task.options) if shifted else {}
    # Seed of the random ones, and of those that follow.
    return {NOMINAL: {}} | changed | draw_worlds(drawn, 4_000_000_000)


def evaluate(
    names: Sequence[str],
    env_id: str,
    worlds: Mapping[str, Mapping[str, Any]],
    episodes: int,
    jobs: int,
) -> list[Row]:
    """Return rows of every decider in every environment, the nominal one first."""
    nominal = task_of(env_id)
    selected = [
        delayed(select_threshold)(nominal, find_decider(name, nominal.options), episodes)
        for name in names
    ]
    usual = dict(zip(names, in_parallel(selected, jobs, "thresholds"), strict=True))
    calls = [
        delayed(evaluate_world)(world, task_of(env_id, options), usual, episodes)
        for world, options in worlds.items()
    ]
    return [row for rows in in_parallel(calls, jobs, "worlds") for row in rows]


def evaluate_world(world: str, task: Task, usual: Mapping[str, float], episodes: int) -> list[Row]:
    """Return rows of all deciders in one environment; `usual` has their nominal thresholds.

    Each uses the threshold with the best reward, selected on other episodes, once of this
    environment and once of the nominal one. Rules that are fitted to an environment are fitted
    here. The row of the first has its differences to the best of the others, and the bound if
    switches are announced.
    """
    goal = task.statistic("reward")
    every = []
    for name, nominal in usual.items():
        decider = find_decider(name, task.options)
        best = nominal if world == NOMINAL else select_threshold(task, decider, episodes)
        thresholds = tuple(dict.fromkeys((best, nominal)))
        every.append(sweep(task, decider, episodes, 0, thresholds=thresholds))
    rows: list[Row] = [
        {
            "world": world,
            "decider": name,
            "threshold": scores.thresholds[0],
            "reward": scores.estimate(goal, 0),
            "nominal_threshold": scores.thresholds[-1],
            "nominal_reward": scores.estimate(goal, -1),
        }
        for name, scores in zip(usual, every, strict=True)
    ]
    first, *others = every
    if task.options.switches == "announced":
        rows[0]["bound"] = bound_scores(task, episodes, 0).estimate(goal, 0)
    if others:
        other = max(others, key=lambda scores: scores.curve(goal)[0])
        rows[0] |= {
            "best_other": other.name,
            "difference": first.difference(other, goal, 0, 0),
            "nominal_difference": first.difference(other, goal, -1, 0),
        }
    return rows


def markdown(rows: Sequence[Row]) -> str:
    """Return a table with environments in rows and deciders in columns."""
    lines = []
    for world, here in pd.DataFrame(rows).groupby("world", sort=False):
        deciders = here.to_dict("records")
        cells = [_cell(row["reward"], row["nominal_reward"]) for row in deciders]
        if len(deciders) > 1:
            cells.append(_cell(deciders[0]["difference"], deciders[0]["nominal_difference"]))
        if "bound" in here:
            cells.append(in_brackets(deciders[0]["bound"], 3, sign="+"))
        lines.append([str(world), *cells])
    names = [row["decider"] for row in deciders]
    head = ["environment", *names, *[f"{names[0]} less the best other"] * (len(names) > 1)]
    return markdown_table([*head, *["bound"] * ("bound" in here)], lines)


def _cell(at_best: Estimate, at_nominal: Estimate) -> str:
    return f"{in_brackets(at_best, 3, sign='+')}; {at_nominal.value:+.3f}"
