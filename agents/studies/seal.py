"""Seals: digests of files that are fixed before closed data are opened."""

from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any


def digests(files: Mapping[str, Path]) -> dict[str, str]:
    """Return the SHA-256 of files by name."""
    return {name: sha256(file.read_bytes()).hexdigest() for name, file in files.items()}


def differing(kept: Mapping[str, Mapping[str, Any]], found: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Return the names whose digests in a seal are not those that are found, by part."""
    return [
        name for part, now in found.items() for name in {**kept[part], **now} if kept[part].get(name) != now.get(name)
    ]
