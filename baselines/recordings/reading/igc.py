"""The position records of a flight log in the IGC format; no other record is kept.

FAI, "Technical specification for GNSS flight recorders", appendix A: a B record has time of day, latitude,
longitude, validity and two altitudes in columns 2 to 35. The I record names further columns, of which LAD and
LOD are more digits of the minutes. The headers, which name the pilot, are not read.
"""

import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from hybrid_env.checks import ArgumentError, FloatArray

DAY = 86400.0
RECORD = re.compile(
    rb"^(B(\d\d)(\d\d)(\d\d)(\d\d)(\d{5})([NS])(\d{3})(\d{5})([EW])[AV]([-\d]\d{4})([-\d]\d{4}))([^\r\n]*)",
    re.MULTILINE,
)
METRES = 111_200.0  # of a degree of latitude


class IgcLog(NamedTuple):
    """Positions of a log.

    Attributes:
        times: (n,) strictly increasing; of the first day [s after midnight UTC].
        latitudes, longitudes: (n,) [deg].
        altitudes: (n,) by pressure, or by satellites where the log has no pressure [m].
        step: resolution of latitude [m].
        records: (n,) the first 35 columns of each B record, for other readers.
    """

    times: FloatArray
    latitudes: FloatArray
    longitudes: FloatArray
    altitudes: FloatArray
    step: float
    records: tuple[bytes, ...]


def is_igc(content: bytes) -> bool:
    """Return whether the content of a file is a log: a capital first, and B records."""
    return content[:100].lstrip(b"\xef\xbb\xbf \r\n")[:1].isupper() and RECORD.search(content) is not None


def parse_igc(name: str, content: bytes) -> IgcLog:
    """Return the positions of a log. Records whose time is not after the one before are left out.

    Args:
        name: of the log, for messages.
        content: of the file.

    Raises:
        ArgumentError: it has fewer than two positions.
    """
    found = RECORD.findall(content)
    if not found:
        raise ArgumentError(f"{name} has no positions (B records): expected at least two")
    columns = list(zip(*found, strict=True))
    numbers = [np.array(columns[k]).astype(np.float64) for k in (1, 2, 3, 4, 5, 7, 8, 10, 11)]
    hours, minutes, seconds, *parts, pressure, satellites = numbers
    times = 3600.0 * hours + 60.0 * minutes + seconds
    times += DAY * np.cumsum(np.diff(times, prepend=times[0]) < -0.5 * DAY)
    head, angles, step = content[: content.index(columns[0][0])], [], 0.0
    for k, signs, negative, word in ((0, 6, b"S", b"LAD"), (2, 9, b"W", b"LOD")):
        more, digits = _more_digits(head, word, columns[12])
        degrees = parts[k] + (parts[k + 1] + more) / 60_000.0
        angles.append(np.where(np.array(columns[signs]) == negative, -degrees, degrees))
        step = METRES / 60_000.0 / 10.0**digits
    latitudes, longitudes = angles
    place = (np.abs(latitudes) <= 90.0) & (np.abs(longitudes) <= 180.0)
    times[~place | ((latitudes == 0.0) & (longitudes == 0.0))] = -np.inf
    kept = np.flatnonzero(times > np.append(-np.inf, np.maximum.accumulate(times)[:-1]))
    if len(kept) < 2:
        raise ArgumentError(f"{name} has {len(kept)} positions: expected at least two")
    altitudes = pressure if np.ptp(pressure) > 0.0 else satellites
    records = tuple(columns[0][k] for k in kept)
    return IgcLog(times[kept], latitudes[kept], longitudes[kept], altitudes[kept], step, records)


def _more_digits(head: bytes, word: bytes, tails: Sequence[bytes]) -> tuple[FloatArray, int]:
    """Return what an extension of the B records adds to thousandths of minutes, (n,), and its digits."""
    for line in re.findall(rb"^I\d\d([^\r\n]*)", head, re.MULTILINE):
        for first, last in re.findall(rb"(\d\d)(\d\d)" + word, line):
            columns = slice(max(int(first) - 36, 0), int(last) - 35)
            cells, digits = np.array([tail[columns] for tail in tails]), int(last) - int(first) + 1
            valid = np.char.isdigit(cells) & (np.char.str_len(cells) == digits)
            if 2 * valid.sum() > len(tails):
                return np.where(valid, cells, b"0").astype(np.float64) / 10.0**digits, digits
    return np.zeros(len(tails)), 0
