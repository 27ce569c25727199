"""Scores with given means, for tables, figures and curves of both tasks."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from agents.evaluation.comparison import Comparison
from agents.evaluation.report import Result
from agents.evaluation.task import task_of
from baselines.rules.decider import rules
from baselines.scoring.decisions import Decisions
from baselines.scoring.scores import Scores

ANNOUNCED = task_of("hybrid_env:HybridTrackPublished-v0", {"scheme": "random 1000x50"})
UNKNOWN = task_of("hybrid_env:HybridTrackQuickest-v0", {"ticks": 150, "durations": "uniform 20-40"})


def scores_of(name, columns, episodes=4, extra=None, **figures):
    """Scores whose episodes are all equal: of each figure named, the values at all thresholds."""
    count = len(next(iter(figures.values())))
    values = np.zeros((episodes, len(columns), count))
    for column, row in figures.items():
        values[:, columns.index(column)] = row
    thresholds = tuple(float(k) for k in range(count))
    return Scores(name, "p", thresholds, columns, values, extra or {})


def announced_scores(name, accuracy, ticks):
    """A decider for announced switches with a delay cost of .02."""
    accuracy, ticks = np.array(accuracy), np.array(ticks)
    return scores_of(
        name,
        Decisions.columns,
        extra={"confusion": np.zeros((len(ticks), 3, 3), int)},
        accuracy=accuracy,
        type_accuracy=accuracy,
        ticks=ticks,
        reward=2 * accuracy - 1 - 0.02 * ticks,
        length=np.full(len(ticks), 60.0),
        squared_error=ticks,
    )


def unknown_scores(name, rates, delays, rewards):
    """A decider for unknown switches that detects all of eight switches."""
    delays, switches = np.array(delays), np.full(len(rates), 8.0)
    return scores_of(
        name,
        UNKNOWN.columns,
        6,
        {"delay_quantiles": np.stack([delays, delays], axis=1)},
        reward=rewards,
        wrong_changes=rates,
        switches=switches,
        detected=switches,
        delay=switches * delays,
        undetected=switches * delays,
    )


def comparison(task, *every, agents=0):
    """A comparison of scores, of which the last `agents` are those of the seeds of one agent.

    The second threshold of the first is its default.
    """
    known = {rule.attribute("title"): name for name, rule in rules(task.switches).items()}
    names = [known.get(scores.name, scores.name) for scores in every]
    default = rules(task.switches)[names[0]].create(task.options).default
    thresholds = tuple(default + (k - 1.0) for k in range(len(every[0].thresholds)))
    every = [replace(every[0], thresholds=thresholds), *every[1:]]
    entries = []
    for name, scores in zip(names, every, strict=True):
        index = task.best(scores)
        selected = float(scores.of("reward", index).mean())
        is_agent = len(entries) >= len(every) - agents
        entries.append(
            Result(task, scores, index, "agent" if is_agent else name, selected, learned=is_agent)
        )
    plan = SimpleNamespace(
        task=task,
        looked_up={entry.decider: (entry.name, False) for entry in entries}
        | {"agent": ("ppo", True)},
        episodes=every[0].episodes,
        selection_episodes=6,
        settings={},
        curves=True,
    )
    return Comparison(plan, entries, None)
