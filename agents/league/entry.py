"""The file of a decider in the league, and whether it is as the league wrote it."""

import base64
import hashlib
import json
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.interface.input_files import read_json
from agents.learned.policy_file import package_versions
from baselines.scoring.scores import Scores
from hybrid_env.checks import reject

PROTOCOL = 1  # number of the protocol; it rises when worlds, episodes or metrics change
LARGEST = 2**20  # bytes of a file
REWARD = "<f4"  # little-endian float32


def make_entry(
    decider: str, title: str, kind: str, worlds: dict[str, Any], cost: dict[str, Any] | None = None
) -> dict[str, Any]:
    """Return the contents of a file, with a digest of them; `cost` is that of a trained family."""
    entry = {
        "protocol": PROTOCOL, "versions": package_versions(), "decider": decider, "title": title,
        "kind": kind, "worlds": worlds,
    }  # fmt: skip
    entry |= {} if cost is None else {"cost": cost}
    return entry | {"digest": _digest(entry)}


def read_entry(path: Path) -> dict[str, Any]:
    """Read the file of a decider; refuse one that was changed, or is of another protocol or version."""
    try:
        entry = read_json(path, LARGEST)
        digest, protocol = entry["digest"], entry["protocol"]
        package, mine = entry["versions"]["hybrid-track"], version("hybrid-track")
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise reject("table", str(path), f"a file of the league ({error})") from None
    if digest != _digest({key: value for key, value in entry.items() if key != "digest"}):
        raise reject("table", str(path), "a file as the league wrote it; this one was changed by hand")
    if (protocol, package) != (PROTOCOL, mine):
        now = f"protocol {PROTOCOL} of version {mine}"
        raise reject("table", str(path), f"{now}; this one is protocol {protocol} of version {package}")
    return dict(entry)


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
