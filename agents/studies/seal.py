"""Seals: digests of code and weights, which are fixed before closed data are opened."""

import json
from collections.abc import Mapping, Sequence
from hashlib import sha256
from pathlib import Path
from typing import Any

from agents.evaluation.registry import SHIPPED, policy_folder
from hybrid_env.checks import reject


def current_digests(
    code: Mapping[str, Path],
    switches: str,
    learned: Mapping[str, str],
    agent: str = SHIPPED,
) -> dict[str, dict[str, str]]:
    """Return the SHA-256 of code by name, of files of an agent of the package for a task, and of
    its weights.
    """
    folder = policy_folder(agent, switches)
    # Importing them loads PyTorch.
    own = {name: folder.parent / f"{file}.py" for name, file in learned.items()}
    parts = {
        "code": {**code, **own},
        "weights": {file.name: file for file in sorted(folder.glob("policy.*"))},
    }
    return {
        part: {name: sha256(file.read_bytes()).hexdigest() for name, file in parts[part].items()}
        for part in parts
    }


def unbroken_seal(
    path: Path,
    found: Mapping[str, Mapping[str, Any]],
    data: str,
    names: Sequence[str] = (),
) -> Any:
    """Return a seal; refuse if anything differs from what is found, or it has no settings of one
    of some names.
    """
    kept = json.loads(path.read_text(encoding="utf-8"))
    differ = [
        one
        for part, now in found.items()
        for one in {**kept[part], **now}
        if kept[part].get(one) != now.get(one)
    ]
    differ += [name for name in names if any(name not in one for one in kept["settings"].values())]
    if differ:
        allowed = (
            f"no value: {', '.join(differ)} differ from {path.name}, and the sealed {data} stay"
            " closed"
        )
        raise reject("sealed", True, allowed)
    return kept
