"""The position records of a flight log in the IGC format; no other record is kept.

FAI, "Technical specification for GNSS flight recorders", appendix A: a B record has time of day,
latitude, longitude, validity and two altitudes in columns 2 to 35. The I record names further
columns, of which LAD and LOD are more digits of the minutes. The headers, which name the pilot, are
not read.
"""

import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from baselines.recordings.reading.cleaning import SET_BACK, ahead_rows, going_on
from baselines.recordings.reading.values import DAY, unwrapped
from hybrid_env.checks import AnyArray, ArgumentError, FloatArray

RECORD = re.compile(
    rb"^(B(\d\d)(\d\d)(\d\d)(\d\d)(\d{5})([NS])(\d{3})(\d{5})([EW])[AV]([-\d]\d{4})([-\d]\d{4}))([^\r\n]*)",
    re.MULTILINE,
)


class IgcLog(NamedTuple):
    """Positions of a log.

    Attributes:
        times: (n,) strictly increasing; of the first day [s after midnight UTC].
        latitudes, longitudes: (n,) [deg].
        altitudes: (n,) by pressure, or by satellites where the log has no pressure [m].
        step: resolution of latitude [m].
        records: (n,) the first 35 columns of each B record, for other readers.
        notes: what was wrong with the clock: positions left out, or times set back, from which on
            `times` are of the next day.
    """

    times: FloatArray
    latitudes: FloatArray
    longitudes: FloatArray
    altitudes: FloatArray
    step: float
    records: tuple[bytes, ...]
    notes: tuple[str, ...] = ()


def is_igc(content: bytes) -> bool:
    """Return whether the content of a file is a log: a capital first, and B records."""
    return (
        content[:100].lstrip(b"\xef\xbb\xbf \r\n")[:1].isupper()
        and RECORD.search(content) is not None
    )


def parse_igc(name: str, content: bytes) -> IgcLog:
    """Return the positions of a log, without those whose time is not after the one before, or has
    jumped for a few records. Where the clock was set back for good, the times go on a day later.

    Args:
        name: of the log, for messages.
        content: of the file.

    Raises:
        ArgumentError: it has fewer than two positions.
    """
    matches = RECORD.findall(content)
    if not matches:
        raise ArgumentError(f"{name} has no positions (B records): expected at least two")
    columns = [np.array(column) for column in zip(*matches, strict=True)]
    hours, minutes, seconds = (column.astype(np.float64) for column in columns[1:4])
    pressure, satellites = (column.astype(np.float64) for column in columns[10:12])
    head = content[: content.index(matches[0][0])]
    extension = _extension(head, b"LAD")
    latitudes = _degrees(columns[4:7], b"S", extension, columns[12])
    longitudes = _degrees(columns[7:10], b"W", _extension(head, b"LOD"), columns[12])
    known = (np.abs(latitudes) <= 90.0) & (np.abs(longitudes) <= 180.0)
    places = np.flatnonzero(known & ((latitudes != 0.0) | (longitudes != 0.0)))
    times = unwrapped((3600.0 * hours + 60.0 * minutes + seconds)[places])
    right = ~ahead_rows(times)
    times, _ = going_on(times[right])
    later = times > np.append(-np.inf, np.maximum.accumulate(times)[:-1])
    times, kept = times[later], places[right][later]
    if len(kept) < 2:
        raise ArgumentError(f"{name} has {len(kept)} positions: expected at least two")
    counts = {
        "positions left out whose time does not fit": len(places) - len(kept),
        SET_BACK: (np.diff(times) > 0.5 * DAY).sum(),
    }
    return IgcLog(
        times,
        latitudes[kept],
        longitudes[kept],
        (pressure if np.ptp(pressure) > 0.0 else satellites)[kept],
        # Of a degree of latitude.
        111_200.0 / 60_000.0 / 10.0 ** (extension.stop - (extension.start or 0)),
        tuple(matches[k][0] for k in kept),
        tuple(f"{what}: {count:,}" for what, count in counts.items() if count),
    )


def _extension(head: bytes, word: bytes) -> slice:
    """Return where the B records have more digits, counted behind their first 35 columns."""
    found = re.search(rb"^I\d\d(?:\d{4}...)*?(\d\d)(\d\d)" + word, head, re.MULTILINE)
    return slice(int(found[1]) - 36, int(found[2]) - 35) if found else slice(0)


def _degrees(
    columns: Sequence[AnyArray], negative: bytes, extension: slice, tails: AnyArray
) -> FloatArray:
    """Return the degrees of whole ones, thousandths of minutes and signs (n,), with the digits of
    an extension where a record has them.
    """
    more = [tail[extension] for tail in tails]
    minutes = [
        float(b"%s.%s" % (thousandths, digits if digits.isdigit() else b"0"))
        for thousandths, digits in zip(columns[1], more, strict=True)
    ]
    degrees = columns[0].astype(np.float64) + np.array(minutes) / 60_000.0
    return np.where(columns[2] == negative, -degrees, degrees)
