"""The protocol of the league: worlds, episodes and what is recorded of a decider."""

import functools
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from agents.evaluation.registry import find_family
from agents.evaluation.task import Task
from agents.evaluation.tasks import BANK, QUICKEST, THREE, task_of
from agents.interface.parallel import Workers
from agents.league.entry import make_entry, pack
from agents.learned.policy_file import LAYOUTS
from agents.studies.shifts import evaluate_world
from baselines.rules.decider import ANNOUNCED, UNKNOWN, Decider
from baselines.rules.own import as_decider
from hybrid_env.checks import ArgumentError

SEED = 600_000_000  # of the first reported episode; no other study reports these episodes
EPISODES = {ANNOUNCED: 600, UNKNOWN: 150}  # reported episodes of each world; as many others select the threshold
WORLDS: dict[str, tuple[str, dict[str, Any]]] = {
    "R = 0.01": (THREE, {"measurement_variance": 0.01}),
    "R = 0.1": (THREE, {}),
    "R = 1": (THREE, {"measurement_variance": 1.0}),
    "5 % outliers": (THREE, {"noise": "outliers 0.05"}),
    "Q x 10": (THREE, {"process_variance": 0.01}),
    "21 modes, R = 0.1": (BANK, {}),
    "21 modes, R = 1": (BANK, {"measurement_variance": 1.0}),
    "unknown, R = 0.01": (QUICKEST, {"measurement_variance": 0.01}),
    "unknown, R = 0.1": (QUICKEST, {}),
    "unknown, R = 1": (QUICKEST, {"measurement_variance": 1.0}),
    "unknown, uniform 50-100": (QUICKEST, {"durations": "uniform 50-100"}),
    "unknown, 5 % outliers": (QUICKEST, {"noise": "outliers 0.05"}),
}
"""Environment and changed options of each world."""


def world_task(world: str) -> Task:
    """Return the task of a world."""
    return task_of(*WORLDS[world])


def play(
    name: str, workers: Workers, on_progress: Callable[[str], None], worlds: Sequence[str] | None = None
) -> dict[str, Any]:
    """Play a decider in all worlds, or some, and return its entry, see `agents.league.entry`.

    The threshold with the best reward is selected in each world, on other episodes than those reported. One that can
    decide in no world is refused.
    """
    calls = {world: functools.partial(_play, name, world) for world in (WORLDS if worlds is None else worlds)}
    found = dict(workers.results(calls, on_progress))
    played = [one for one in found.values() if "refused" not in one]
    if not played:
        raise ArgumentError(next(iter(found.values()))["refused"])
    titles, kinds = ([one.pop(key) for one in played] for key in ("title", "kind"))
    return make_entry(name, titles[0], kinds[0], found)


def _play(name: str, world: str) -> dict[str, Any]:
    """Return title, kind, threshold, metrics and rewards of a decider in a world, or why there are none."""
    task = world_task(world)
    try:
        family = find_family(name, task.options)
        shift = evaluate_world(name, world, task, None, EPISODES[task.switches], SEED)
    except ArgumentError as error:
        return {"refused": str(error)}
    (threshold,), rewards = shift.own.thresholds, shift.own.of(task.goal, 0)
    return {
        "title": family.name, "kind": kind_of(as_decider(family.make(threshold)), task), "threshold": threshold,
        "metrics": {one.name: shift.own.estimate(one.statistic).as_json() for one in task.metrics},
        "rewards": pack(rewards),
    }  # fmt: skip


def kind_of(decider: Decider, task: Task) -> str:
    """Return what a decider uses: "informed" of what a user does not know, a "classical" rule, else memory.

    Learned and own deciders are "recurrent" if they keep a state or filters of their own, else "memoryless".
    """
    if decider.informed:
        return "informed"
    if type(decider).__module__.startswith("baselines.rules.") and type(decider).name:
        return "classical"
    if decider.observes == "tracks":
        return "recurrent"
    rows = np.zeros((1, LAYOUTS[task.switches](task.options.hypotheses).width), np.float32)
    _, state = decider.predict(rows, None, np.ones(1, np.bool_))
    return "memoryless" if state is None else "recurrent"
