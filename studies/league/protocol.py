"""The protocol of the league: worlds, episodes, and the file of a decider, with a digest of its
contents.
"""

import base64
import hashlib
import json
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

import joblib
import numpy as np
from numpy.typing import NDArray

from agents import Task, find_decider, select_threshold, sweep, task_of
from baselines import Decider, Scores
from hybrid_env import ArgumentError
from studies.league import reward

# The weights of this algorithm can be loaded, because it is imported.
REWARD = reward.Reward
# Number of the protocol; it rises when worlds, episodes or metrics change.
PROTOCOL = 1
# Three hypotheses, 21 hypotheses, and three with unknown switch moments.
THREE = "hybrid_env:HybridTrackPublished-v0"
BANK = "hybrid_env:HybridTrackPublishedBank-v0"
QUICKEST = "hybrid_env:HybridTrackQuickest-v0"
# Seed of the first reported episode; no other study reports these episodes.
SEED = 600_000_000
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
EPISODES = {world: 150 if env_id == QUICKEST else 600 for world, (env_id, _) in WORLDS.items()}
"""Reported episodes of each world; as many others select the threshold."""


def world_task(world: str) -> Task:
    """Return the task of a world."""
    return task_of(*WORLDS[world])


def play(name: str, episodes: Mapping[str, int], jobs: int = 1) -> dict[str, Any]:
    """Return the entry of a decider, from a number of episodes in each world; refuse one that can
    decide in none. The results do not depend on the number of processes.
    """
    calls = (joblib.delayed(play_world)(name, *each) for each in episodes.items())
    worlds = dict(zip(episodes, joblib.Parallel(n_jobs=jobs)(calls), strict=True))
    played = [world for world in worlds.values() if "refused" not in world]
    if not played:
        raise ArgumentError(next(iter(worlds.values()))["refused"])
    titles = [(world.pop("title"), world.pop("kind")) for world in played]
    return make_entry(name, *titles[0], worlds)


def play_world(name: str, world: str, episodes: int) -> dict[str, Any]:
    """Return title, kind, threshold, metrics and rewards of a decider in a world, or why there
    are none.

    The threshold with the best reward is selected, on other episodes than those reported.
    """
    task = world_task(world)
    try:
        decider = find_decider(name, task.options)
        threshold = select_threshold(task, decider, episodes)
        scores = sweep(task, decider, episodes, SEED, thresholds=(threshold,))
    except ArgumentError as error:
        return {"refused": str(error)}
    return {
        "title": decider.title,
        "kind": kind_of(decider.at(threshold), task),
        "threshold": threshold,
        "metrics": {
            metric.name: scores.estimate(metric.statistic).as_json() for metric in task.metrics
        },
        "rewards": pack(scores.of("reward", 0)),
    }


def kind_of(decider: Decider, task: Task) -> str:
    """Return "informed" of what a user does not know, "classical" rule, "recurrent" with memory,
    or "memoryless".
    """
    if decider.oracle:
        return "informed"
    if type(decider).__module__.startswith("baselines.rules.") and type(decider).name:
        return "classical"
    if decider.observes == "tracks":
        return "recurrent"
    rows = np.zeros((1, task.options.layout_class(task.options.hypotheses).width), np.float32)
    _, state = decider.predict(rows, None, np.ones(1, np.bool_))
    return "memoryless" if state is None else "recurrent"


def make_entry(decider: str, title: str, kind: str, worlds: dict[str, Any]) -> dict[str, Any]:
    """Return the contents of a file, with a digest of them."""
    entry = {
        "protocol": PROTOCOL,
        "versions": {
            package: version(package)
            for package in ("hybrid-track", "stable-baselines3", "torch", "numpy", "numba")
        },
        "decider": decider,
        "title": title,
        "kind": kind,
        "worlds": worlds,
    }
    return entry | {"digest": digest(entry)}


def read_entry(path: Path) -> dict[str, Any]:
    """Read the file of a decider; refuse one that was changed, or is of another protocol or
    version.
    """
    expected = PROTOCOL, version("hybrid-track")
    try:
        entry: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        unchanged = entry["digest"] == digest(entry)
        origin = entry["protocol"], entry["versions"]["hybrid-track"]
    except (ValueError, KeyError, TypeError) as error:
        raise ArgumentError(f"{path} is no file of the league ({error})") from None
    if not unchanged:
        raise ArgumentError(f"{path} was changed by hand")
    if origin != expected:
        message = "{} is of protocol {} of version {}: expected protocol {} of version {}"
        raise ArgumentError(message.format(path, *origin, *expected))
    return entry


def pack(rewards: NDArray[np.float64]) -> str:
    """Return the rewards of episodes (E,) as text: little-endian float32 in base 64."""
    return base64.b64encode(rewards.astype("<f4").tobytes()).decode()


def scores_of(entry: Mapping[str, Any], world: str) -> Scores | None:
    """Return the rewards of all episodes in a world; None where it did not play."""
    content = entry["worlds"].get(world, {})
    if "rewards" not in content:
        return None
    rewards = np.frombuffer(base64.b64decode(content["rewards"]), "<f4").astype(np.float64)
    values = rewards[:, None, None]
    return Scores(entry["title"], "", (content["threshold"],), ("reward",), values)


def digest(entry: Mapping[str, Any]) -> str:
    """Return the digest of an entry, without the one that it states."""
    content = {key: value for key, value in entry.items() if key != "digest"}
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
