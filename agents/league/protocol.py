"""The protocol of the league: worlds, episodes, and the file of a decider, with a digest of its
contents.
"""

import base64
import functools
import hashlib
import json
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.evaluation.registry import find_family
from agents.evaluation.task import Task
from agents.evaluation.tasks import BANK, QUICKEST, THREE, task_of
from agents.interface.input_files import read_json
from agents.interface.parallel import Workers
from agents.learned.policy_file import LAYOUTS, package_versions
from agents.studies.shifts import evaluate_world
from baselines.rules.decider import ANNOUNCED, UNKNOWN, Decider
from baselines.rules.own import as_decider
from baselines.scoring.scores import Scores
from hybrid_env.checks import (
    ArgumentError,
    check_choice,
    check_number,
    check_positive,
    optional,
    ranged,
    reject,
)

# Number of the protocol; it rises when worlds, episodes or metrics change.
PROTOCOL = 1
# Bytes of a file.
LARGEST = 2**20
# Little-endian float32.
REWARD = "<f4"
# Of a mean of such rewards.
ROUNDING = 1e-5
KINDS = ("informed", "recurrent", "memoryless", "classical")
COSTS = {
    "calibration": optional(ranged(-1.0, 1.0)),
    "microseconds": optional(check_positive),
    "seconds": optional(check_positive),
}
"""Figures of the cost of a family, with the checks of their values."""
# Of an episode; the largest is that of right decisions without delay.
check_reward = ranged(-10.0, 1.0)
# Of the first reported episode; no other study reports these episodes.
SEED = 600_000_000
# Reported episodes of each world; as many others select the threshold.
EPISODES = {ANNOUNCED: 600, UNKNOWN: 150}
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
GROUPS = {
    env_id: [world for world in WORLDS if WORLDS[world][0] == env_id]
    for env_id, _ in WORLDS.values()
}
"""Worlds by environment."""


def world_task(world: str) -> Task:
    """Return the task of a world."""
    return task_of(*WORLDS[world])


def play(
    name: str,
    workers: Workers,
    on_progress: Callable[[str], None],
    worlds: Sequence[str] | None = None,
    title: str | None = None,
) -> dict[str, Any]:
    """Play a decider in all worlds, or some, and return its entry.

    The threshold with the best reward is selected in each world, on other episodes than those
    reported. One that can decide in no world is refused.
    """
    calls = {
        world: functools.partial(_play, name, world)
        for world in (WORLDS if worlds is None else worlds)
    }
    found = dict(workers.results(calls, on_progress))
    played = [one for one in found.values() if "refused" not in one]
    if not played:
        raise ArgumentError(next(iter(found.values()))["refused"])
    titles, kinds = ([one.pop(key) for one in played] for key in ("title", "kind"))
    return make_entry(name, titles[0] if title is None else title, kinds[0], found)


def _play(name: str, world: str) -> dict[str, Any]:
    """Return title, kind, threshold, metrics and rewards of a decider in a world, or why there
    are none.
    """
    task = world_task(world)
    try:
        family = find_family(name, task.options)
        shift = evaluate_world(name, world, task, None, EPISODES[task.switches], SEED)
    except ArgumentError as error:
        return {"refused": str(error)}
    (threshold,), rewards = shift.own.thresholds, shift.own.of(task.goal, 0)
    return {
        "title": family.name,
        "kind": kind_of(as_decider(family.make(threshold)), task),
        "threshold": threshold,
        "metrics": {one.name: shift.own.estimate(one.statistic).as_json() for one in task.metrics},
        "rewards": pack(rewards),
    }


def kind_of(decider: Decider, task: Task) -> str:
    """Return "informed" of what a user does not know, "classical" rule, "recurrent" with memory,
    or "memoryless".
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


def make_entry(
    decider: str,
    title: str,
    kind: str,
    worlds: dict[str, Any],
    cost: dict[str, Any] | None = None,
) -> dict[str, Any]:
    """Return the contents of a file, with a digest of them; `cost` is that of a trained family."""
    entry = {
        "protocol": PROTOCOL,
        "versions": package_versions(),
        "decider": decider,
        "title": title,
        "kind": kind,
        "worlds": worlds,
    }
    entry |= {} if cost is None else {"cost": cost}
    return entry | {"digest": _digest(entry)}


def read_entry(path: Path) -> dict[str, Any]:
    """Read the file of a decider; refuse one that was changed, or is of another protocol or
    version.
    """
    try:
        entry = read_json(path, LARGEST)
        digest = entry["digest"]
        protocol = entry["protocol"]
        package = entry["versions"]["hybrid-track"]
        mine = version("hybrid-track")
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise reject("table", str(path), f"a file of the league ({error})") from None
    if digest != _digest({key: value for key, value in entry.items() if key != "digest"}):
        raise reject(
            "table",
            str(path),
            "a file as the league wrote it; this one was changed by hand",
        )
    if (protocol, package) != (PROTOCOL, mine):
        now = f"protocol {PROTOCOL} of version {mine}"
        raise reject(
            "table",
            str(path),
            f"{now}; this one is protocol {protocol} of version {package}",
        )
    try:
        _check_entry(entry)
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise reject("table", str(path), f"a file as the league writes it ({error})") from None
    return dict(entry)


def _check_entry(entry: dict[str, Any]) -> None:
    """Check types, kind, worlds, lengths and ranges of an entry: a digest can be made by anyone."""
    for name in ("title", "decider"):
        text = entry[name]
        if not isinstance(text, str) or not text.isprintable() or text != text.strip() or not text:
            raise reject(name, text, "a text of one line")
    check_choice("kind", entry["kind"], KINDS)
    for world, content in entry["worlds"].items():
        check_choice("world", world, WORLDS)
        if content.keys() != {"refused"}:
            _check_world(world, content)
        elif not isinstance(content["refused"], str):
            raise reject("refused", content["refused"], "a text")
    seeds = {
        world: len(content["seeds"])
        for world, content in entry["worlds"].items()
        if "seeds" in content
    }
    if seeds or "cost" in entry:
        if set(seeds) not in map(set, GROUPS.values()) or len(set(seeds.values())) > 1:
            raise reject("seeds", seeds, "as many in each world of one environment")
        if [*entry["cost"]] != [*COSTS]:
            raise reject("cost", entry["cost"], f"the figures {', '.join(COSTS)}")
        for name, check in COSTS.items():
            check(name, entry["cost"][name])


def _check_world(world: str, content: dict[str, Any]) -> None:
    """Check what a decider did in a world: its threshold, metrics and rewards, whose mean is
    that of the metrics.
    """
    task = world_task(world)
    if content.keys() - {"seeds"} != {"threshold", "metrics", "rewards"}:
        raise reject(world, list(content), "threshold, metrics and rewards")
    check_number("threshold", content["threshold"])
    if content["metrics"].keys() != {metric.name for metric in task.metrics}:
        raise reject("metrics", list(content["metrics"]), f"those of {task.title}")
    for name, metric in content["metrics"].items():
        for part in ("value", "low", "high"):
            optional(check_number)(f"{name} {part}", metric.get(part))
    rewards = np.frombuffer(base64.b64decode(content["rewards"], validate=True), REWARD)
    if len(rewards) != EPISODES[task.switches]:
        raise reject(f"rewards in {world}", len(rewards), f"{EPISODES[task.switches]} numbers")
    for reward in (*rewards.tolist(), *content.get("seeds", [])):
        check_reward(f"reward in {world}", reward)
    means = [
        content["metrics"][task.goal]["value"],
        *([np.mean(content["seeds"])] if "seeds" in content else []),
    ]
    if not np.allclose(means, rewards.mean(dtype=np.float64), rtol=0.0, atol=ROUNDING):
        raise reject(f"mean reward in {world}", means[0], "that of the rewards")


def pack(rewards: NDArray[np.float64]) -> str:
    """Return the rewards of episodes (E,) as text: float32 in base 64."""
    return base64.b64encode(rewards.astype(REWARD).tobytes()).decode()


def scores_of(entry: dict[str, Any], world: str) -> Scores | None:
    """Return the rewards of all episodes in a world; None where it did not play."""
    one = entry["worlds"].get(world, {})
    if "rewards" not in one:
        return None
    rewards = np.frombuffer(base64.b64decode(one["rewards"]), REWARD).astype(np.float64)
    return Scores(entry["title"], "", (one["threshold"],), ("reward",), rewards[:, None, None])


def _digest(entry: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(entry, sort_keys=True).encode()).hexdigest()
