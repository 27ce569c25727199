"""The position records of a flight log in the IGC format; no other record is kept.

FAI, "Technical specification for GNSS flight recorders", appendix A: a B record has time of day,
latitude, longitude, validity and two altitudes in columns 2 to 35. The I record names further
columns, of which LAD and LOD are more digits of the minutes. The headers, which name the pilot, are
not read.
"""

import re
from typing import NamedTuple

import numpy as np
import pandas as pd

from baselines.recordings.reading.cleaning import SET_BACK, ahead_rows, going_on
from baselines.recordings.reading.values import DAY, unwrapped
from hybrid_env.checks import ArgumentError, FloatArray

RECORD = re.compile(
    r"^(B(\d\d)(\d\d)(\d\d)(\d\d)(\d{5})([NS])(\d{3})(\d{5})([EW])[AV]([-\d]\d{4})([-\d]\d{4}))([^\r\n]*)",
    re.MULTILINE,
)
# Of a record; minutes are thousandths, whose further digits may be in `more`.
FIELDS = (
    *("record", "hours", "minutes", "seconds", "lat_degrees", "lat_minutes", "lat_side"),
    *("lon_degrees", "lon_minutes", "lon_side", "pressure", "satellites", "more"),
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
    first = content[:100].lstrip(b"\xef\xbb\xbf \r\n")[:1]
    record = re.search(rb"^B\d{13}[NS]\d{8}[EW]", content, re.MULTILINE)
    return first.isupper() and record is not None


def parse_igc(name: str, content: bytes) -> IgcLog:
    """Return the positions of a log, without those whose time is not after the one before, or has
    jumped for a few records. Where the clock was set back for good, the times go on a day later.

    Args:
        name: of the log, for messages.
        content: of the file.

    Raises:
        ArgumentError: it has fewer than two positions.
    """
    text = content.decode("latin-1")
    fixes = pd.DataFrame(RECORD.findall(text), columns=FIELDS)
    if fixes.empty:
        raise ArgumentError(f"{name} has no positions (B records): expected at least two")
    head = text[: text.index(fixes.record[0])]
    extension = _extension(head, "LAD")
    fixes["lat"] = _degrees(fixes, "lat", extension)
    fixes["lon"] = _degrees(fixes, "lon", _extension(head, "LOD"))
    altitude = "satellites" if fixes.pressure.nunique() == 1 else "pressure"
    nowhere = (fixes.lat == 0.0) & (fixes.lon == 0.0)
    places = fixes[(fixes.lat.abs() <= 90.0) & (fixes.lon.abs() <= 180.0) & ~nowhere]
    clock = places[["hours", "minutes", "seconds"]].to_numpy(float) @ [3600.0, 60.0, 1.0]
    kept = places.assign(time=unwrapped(clock))
    kept = kept[~ahead_rows(kept.time.to_numpy())]
    kept = kept.assign(time=going_on(kept.time.to_numpy())[0])
    kept = kept[kept.time > kept.time.cummax().shift(fill_value=-np.inf)]
    if len(kept) < 2:
        raise ArgumentError(f"{name} has {len(kept)} positions: expected at least two")
    counts = {
        "positions left out whose time does not fit": len(places) - len(kept),
        SET_BACK: (kept.time.diff() > 0.5 * DAY).sum(),
    }
    return IgcLog(
        kept.time.to_numpy(),
        kept.lat.to_numpy(),
        kept.lon.to_numpy(),
        kept[altitude].to_numpy(float),
        # Of a degree of latitude.
        111_200.0 / 60_000.0 / 10.0 ** (extension.stop - (extension.start or 0)),
        tuple(kept.record.map(str.encode)),
        tuple(f"{what}: {count:,}" for what, count in counts.items() if count),
    )


def _extension(head: str, word: str) -> slice:
    """Return where the B records have more digits, counted behind their first 35 columns."""
    found = re.search(rf"^I\d\d(?:\d{{4}}...)*?(\d\d)(\d\d){word}", head, re.MULTILINE)
    return slice(int(found[1]) - 36, int(found[2]) - 35) if found else slice(0)


def _degrees(fixes: pd.DataFrame, axis: str, extension: slice) -> "pd.Series[float]":
    """Return the degrees of an axis, with the digits of an extension where a record has them."""
    digits = fixes.more.str[extension]
    digits = digits.where(digits.str.isdigit(), "0")
    minutes = (fixes[f"{axis}_minutes"] + "." + digits).astype(float)
    degrees = fixes[f"{axis}_degrees"].astype(float) + minutes / 60_000.0
    return degrees.where(fixes[f"{axis}_side"].isin(["N", "E"]), -degrees)
