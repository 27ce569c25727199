"""The seal of data that stayed closed until all was fixed: digests of code, weights, programs."""

import json
from collections.abc import Iterable
from hashlib import sha256
from importlib.metadata import distributions
from pathlib import Path
from typing import Any

from hybrid_env import ArgumentError


def seal_of(
    code: Iterable[Path],
    weights: Path,
    programs: Iterable[str],
) -> dict[str, dict[str, str]]:
    """Return the SHA-256 of files of code and of the policy in a folder, and the versions of
    installed programs.
    """
    digests = {
        part: {
            f"{path.parent.name}/{path.name}": sha256(path.read_bytes()).hexdigest()
            for path in paths
        }
        for part, paths in (("code", code), ("weights", sorted(weights.glob("policy.*"))))
    }
    versions = {
        name: next((program.version for program in distributions(name=name)), "missing")
        for name in programs
    }
    return digests | {"programs": versions}


def unbroken_seal(file: Path, present: dict[str, dict[str, str]]) -> dict[str, Any]:
    """Return the content of a seal; refuse if anything differs from the present one."""
    kept: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    differ = [
        name
        for part, named in present.items()
        for name, value in named.items()
        if kept[part].get(name) != value
    ]
    if differ:
        raise ArgumentError(f"{', '.join(differ)} differ from {file.name}: the data stay closed")
    return kept
