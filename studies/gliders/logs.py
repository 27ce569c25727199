"""Flights of paragliders: the logs in the tests of the npm package igc-xc-score 1.8.0, where the
user has it.

The package has the licence LGPL-3.0-or-later; its logs carry no terms of their own. They name
pilots, so a log is known by the first eight digits of its SHA-256 only. Sixteen logs, in two
halves, are open to development. The others are sealed: their bytes are hashed, and nothing else is
read before weights, settings and labels are frozen.
"""

import hashlib
import tarfile
from pathlib import Path

from baselines import IgcLog
from hybrid_env import ArgumentError
from studies.flights.flight import Flight, Tier, on_plane

HALVES = {
    "A": "cd09652f 4bb015b2 9eda24c9 0935cf0a 2db3bc4f a507d60d bdf970cc f31276f9",
    "B": "c0ac3c64 37d715ef a70f0b86 15ec1e84 e6737605 dc9160c7 efe900e9 d56e0aed",
}
"""The logs that are open."""
SEALED = "sealed"
# Too short, or with 5 s between positions.
LEFT_OUT = ("29cd4087", "787d5dad", "e483b3e5")
EXPECTED = (
    "the archive igc-xc-score-1.8.0.tgz (npm pack igc-xc-score@1.8.0), or a folder with its logs"
)


def read_logs(source: Path, half: str) -> dict[str, bytes]:
    """Return the logs of a half, or the sealed ones, of an archive or folder by the first eight
    digits of their SHA-256.

    Raises:
        ArgumentError: there are none, or they cannot be read.
    """
    try:
        if source.is_dir():
            contents = [path.read_bytes() for path in source.rglob("*.igc")]
        else:
            with tarfile.open(source) as archive:
                members = [member for member in archive if member.name.endswith(".igc")]
                files = map(archive.extractfile, members)
                contents = [file.read() for file in files if file is not None]
    except (OSError, EOFError, tarfile.TarError):
        contents = []
    logs = {digits(content): content for content in contents}
    chosen = {name: content for name, content in logs.items() if half_of(name) == half}
    if not chosen:
        raise ArgumentError(f"source={str(source)!r}: expected {EXPECTED}: no log of half {half}")
    return chosen


def digits(content: bytes) -> str:
    """Return the first eight digits of the SHA-256 of a log."""
    return hashlib.sha256(content).hexdigest()[:8]


def half_of(identity: str) -> str:
    """Return the half of a log, or that it is sealed or left out."""
    if identity in LEFT_OUT:
        return ""
    return next((half for half, logs in HALVES.items() if identity in logs.split()), SEALED)


def glider_flight(identity: str, group: str, log: IgcLog) -> Flight:
    """Return the flight of a log; its tier is its group, with the error of a position in this
    log.
    """
    return Flight(
        identity,
        error_tier(group, log.step),
        log.times - log.times[0],
        on_plane(log.latitudes, log.longitudes),
        altitudes=log.altitudes,
    )


def error_tier(group: str, step: float) -> Tier:
    """Return a tier with the error of positions that are rounded to steps [m]: a standard deviation
    of 0.3 m across the velocity, and what the rounding adds.
    """
    return Tier(group, 0.3 + 0.15 * step, 0.0)
