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

import numpy as np

from baselines import IgcLog
from hybrid_env import ArgumentError
from studies.flights.flight import Flight, Tier, on_plane

HALVES = {
    "A": (
        "cd09652f",
        "4bb015b2",
        "9eda24c9",
        "0935cf0a",
        "2db3bc4f",
        "a507d60d",
        "bdf970cc",
        "f31276f9",
    ),
    "B": (
        "c0ac3c64",
        "37d715ef",
        "a70f0b86",
        "15ec1e84",
        "e6737605",
        "dc9160c7",
        "efe900e9",
        "d56e0aed",
    ),
}
"""The logs that are open."""
SEALED = "sealed"
LEFT_OUT = ("29cd4087", "787d5dad", "e483b3e5")
"""Too short, or with 5 s between positions."""
ACROSS, ROUNDING = 0.3, 0.15
"""Standard deviation of a position across the velocity [m], and what each metre of rounding
adds.
"""

EXPECTED = (
    "the archive igc-xc-score-1.8.0.tgz (npm pack igc-xc-score@1.8.0), or a folder with its logs"
)


def read_logs(source: Path | str) -> dict[str, bytes]:
    """Return the contents of the `.igc` files of an archive or folder, by the digits of their
    digest.

    Raises:
        ArgumentError: there are none, or they cannot be read.
    """
    place = Path(source)
    suffix = ".igc"
    try:
        if place.is_dir():
            contents = [path.read_bytes() for path in place.rglob(f"*{suffix}")]
        else:
            with tarfile.open(place) as archive:
                members = [one for one in archive if one.isfile() and one.name.endswith(suffix)]
                contents = [archive.extractfile(one).read() for one in members]  # type: ignore[union-attr]
    except (OSError, EOFError, tarfile.TarError):
        contents = []
    if not contents:
        raise ArgumentError(f"source={str(source)!r}: expected {EXPECTED}")
    return {digits(content): content for content in contents}


def digits(content: bytes) -> str:
    """Return the first eight digits of the SHA-256 of a log."""
    return hashlib.sha256(content).hexdigest()[:8]


def half_of(identity: str) -> str:
    """Return the half of a log, or that it is sealed or left out."""
    if identity in LEFT_OUT:
        return ""
    return next((half for half, logs in HALVES.items() if identity in logs), SEALED)


def glider_flight(identity: str, group: str, log: IgcLog) -> Flight:
    """Return the flight of a log; its tier is its group, with the error of a position in this
    log.
    """
    return Flight(
        identity,
        error_tier(group, log.step),
        log.times - log.times[0],
        on_plane(log.latitudes, log.longitudes),
        np.full(len(log.times), np.nan),
        altitudes=log.altitudes,
    )


def error_tier(group: str, step: float) -> Tier:
    """Return a tier with the error of positions that are rounded to steps [m]."""
    return Tier(group, ACROSS + ROUNDING * step, 0.0)
