"""The seal of data that stayed closed until all was fixed: digests of code, weights, programs."""

import json
from hashlib import sha256
from importlib.metadata import distributions
from pathlib import Path
from typing import Any

from hybrid_env import ArgumentError


def current_seal(file: Path) -> dict[str, Any]:
    """Return a seal with the present digests (SHA-256) of the code and the weights that it lists,
    by their paths in this folder, and the installed versions of its programs.
    """
    seal: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    for part in (seal["code"], seal["weights"]):
        for name in part:
            part[name] = sha256((Path(__file__).parent / name).read_bytes()).hexdigest()
    for name in seal["programs"]:
        versions = (program.version for program in distributions(name=name))
        seal["programs"][name] = next(versions, "missing")
    return seal


def unbroken_seal(file: Path) -> dict[str, Any]:
    """Return the content of a seal; refuse if anything differs from the present one."""
    kept: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    differ = [
        name
        for part, named in current_seal(file).items()
        for name, value in named.items()
        if kept[part][name] != value
    ]
    if differ:
        raise ArgumentError(f"{', '.join(differ)} differ from {file.name}: the data stay closed")
    return kept
