"""Scores with given means, for tables, figures and curves of both tasks."""

from dataclasses import replace

import numpy as np

from agents.commands.comparison import Comparison, Entry
from agents.commands.continuation import Plan
from agents.evaluation.announced import AnnouncedTask
from agents.evaluation.unknown import UnknownTask
from baselines.rules.decider import rules
from baselines.scoring import decisions, statements
from baselines.scoring.scores import Scores

SEGMENTS = 1000
ANNOUNCED = AnnouncedTask("hybrid_env:HybridTrackPublished-v0", {"scheme": f"random {SEGMENTS}x50"})
UNKNOWN = UnknownTask(
    "hybrid_env:HybridTrackQuickest-v0",
    {"ticks": 150, "durations": "uniform 20-40"},
)


def scores_of(name, columns, episodes=4, extra=None, **figures):
    """Scores whose episodes are all equal: of each figure named, the values at all thresholds."""
    count = len(next(iter(figures.values())))
    values = np.zeros((episodes, len(columns), count))
    for column, row in figures.items():
        values[:, columns.index(column)] = row
    return Scores(
        name,
        "p",
        tuple(float(k) for k in range(count)),
        columns,
        values,
        extra or {},
    )


def announced_scores(name, accuracy, ticks, episodes=4):
    """A decider for announced switches with a delay cost of .02."""
    accuracy, ticks = np.array(accuracy), np.array(ticks)
    return scores_of(
        name,
        decisions.COLUMNS,
        episodes,
        {"confusion": np.zeros((len(ticks), 3, 3), int)},
        accuracy=accuracy,
        type_accuracy=accuracy,
        ticks=ticks,
        reward=2 * accuracy - 1 - 0.02 * ticks,
        length=np.full(len(ticks), 60.0),
        squared_error=ticks,
    )


def unknown_scores(name, rates, delays, rewards, tracks=6):
    """A decider for unknown switches that detects all of eight switches."""
    delays, switches = np.array(delays), np.full(len(rates), 8.0)
    quantiles = np.stack([delays, delays], axis=1)
    return scores_of(
        name,
        statements.COLUMNS,
        tracks,
        {"delay_quantiles": quantiles},
        reward=rewards,
        wrong_changes=rates,
        switches=switches,
        detected=switches,
        delay=switches * delays,
        undetected=switches * delays,
    )


def comparison(task, *found, chosen=None, agents=0, accuracy=None, curves=True):
    """A comparison of scores; the last `agents` of them are those of agents."""
    known = {rule.attribute("title"): name for name, rule in rules(task.switches).items()}
    reference = rules(task.switches)[known[found[0].name]].create(task.options)
    shifted = tuple(reference.default + (k - 1.0) for k in range(len(found[0].thresholds)))
    # The second one is the default.
    found = [replace(found[0], thresholds=shifted), *found[1:]]
    names = tuple(known.get(one.name, one.name) for one in found)
    count = len(names) - agents
    plan = Plan(
        task,
        names[:count],
        names[count:],
        found[0].episodes,
        0,
        6,
        None,
        1,
        accuracy,
        curves,
    )
    entries = []
    for name, one in zip(names, found, strict=True):
        index = task.best(one) if chosen is None else min(chosen, len(one.thresholds) - 1)
        entries.append(
            Entry(
                one,
                index,
                name,
                float(one.of("reward", index).mean()),
            )
        )
    return Comparison(plan, tuple(entries))
