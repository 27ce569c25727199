"""From cells to numbers, angles and times."""

import functools
import re
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from baselines.recordings.reading.names import SECONDS
from hybrid_env.checks import AnyArray, BoolArray, FloatArray, reject

DAY = 86400.0
# Numbers, which cells are not empty and none, and whether the decimal mark is a comma.
Parsed = tuple[FloatArray, BoolArray, bool]
Parser = Callable[[pd.Series, str | None], Parsed]
CLOCKS = (
    *("%H:%M:%S", "%H:%M:%S.%f", "%H:%M", "%H%M%S", "%H%M%S.%f"),
    *("%I:%M:%S %p", "%I:%M:%S.%f %p", "%I:%M %p"),
)
DAYS = (
    *("%d/%m/%Y", "%d.%m.%Y", "%d-%m-%Y", "%m/%d/%Y", "%m.%d.%Y", "%m-%d-%Y"),
    *("%d/%m/%y", "%d.%m.%y", "%d-%m-%y", "%m/%d/%y", "%m.%d.%y", "%m-%d-%y"),
    *("%d-%b-%Y", "%d %b %Y", "%Y%m%d", "%y%m%d", "%d%m%y"),
)
FORMS = (
    *("%Y%m%d%H%M%S", "%Y%m%d%H%M%S.%f", *CLOCKS, *DAYS),
    *(f"{day} {clock}" for day in DAYS for clock in CLOCKS),
)
"""Formats of times that are recognised beside ISO 8601."""


class Times(NamedTuple):
    """Times of all rows of a file."""

    # (n,) [s], NaN where a cell is no time; dates are counted from the earliest one.
    seconds: FloatArray
    # Date of time 0, ISO 8601; None for times without a date.
    epoch: str | None
    # How the cells were understood, for the summary.
    kind: str
    # Or `ticks` for numbers of rows.
    unit: str = "s"
    # (n,) numbers or texts of a single column; None for other types and several columns.
    cells: AnyArray | None = None


def texts_of(cells: pd.Series) -> pd.Series:
    """Return cells as texts without spaces around them, "" where they are empty."""
    return cells.astype(object).where(cells.notna(), "").astype("str").str.strip()


def cell_text(value: Any) -> str:
    """Return a cell as short text; whole numbers have no decimal point, and what would be a formula
    no quotation mark before it, as `hybridtrack track` writes it.
    """
    text = re.sub(r"^(\d+)\.0+$", r"\1", " ".join(str(value).split()))[:60]
    return re.sub(r"^'(?=[=+\-@|])", "", writable(text))


def writable(text: str) -> str:
    """Return a text without characters that XML or UTF-8 does not have."""
    return re.sub(r"[\0-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]", "\ufffd", text)


def names_of(cells: pd.Series) -> pd.Series:
    """Return cells as names of objects, none where they are empty."""
    return cells.map({cell: cell_text(cell) for cell in cells.dropna().unique()})


def parse_numbers(cells: pd.Series, thousands: str | None = None) -> Parsed:
    """Parse cells as numbers with a decimal point, or all with a decimal comma.

    Args:
        cells: of a column.
        thousands: mark between thousands, which is removed.

    Returns:
        numbers, NaN where a cell is none; which cells are not empty and no numbers; whether the
        decimal mark is a comma.
    """
    if pd.api.types.is_bool_dtype(cells) or pd.api.types.is_datetime64_any_dtype(cells):
        cells = cells.astype("str")
    comma = False
    numbers = pd.to_numeric(cells, errors="coerce")
    if thousands is not None or (numbers.isna() & cells.notna()).any():
        texts = texts_of(cells).str.replace(thousands or " ", "", regex=False)
        # A decimal comma is one where no cell has a point.
        points = texts.str.contains(".", regex=False).any()
        comma = not points and bool(texts.str.fullmatch(r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?").any())
        texts = texts.str.replace(",", ".", regex=False) if comma else texts
        numbers = pd.to_numeric(texts, errors="coerce")
        cells = cells.where(texts != "")
    values = numbers.to_numpy(np.float64, na_value=np.nan)
    values = np.where(np.isfinite(values), values, np.nan)
    return values, np.isnan(values) & cells.notna().to_numpy(), comma


def parse_angles(cells: pd.Series, thousands: str | None = None) -> Parsed:
    """Parse cells as degrees, as `parse_numbers` does; also with a letter of the hemisphere, and
    with minutes and seconds.
    """
    values, wrong, comma = parse_numbers(cells, thousands)
    if wrong.any():
        number, mark = r"(\d+(?:[.,]\d+)?)", r"[\s°º:'\u2019\u2032\"\u201d\u2033]"
        more = rf"(?:{mark}+{number})?"
        parts = texts_of(cells).str.extract(
            rf"^([NSEW]?)\s*([+-]?){number}{more}{more}{mark}*([NSEW]?)$"
        )
        read = parts[2].notna().to_numpy()
        numbers = parts[[2, 3, 4]].fillna("0").apply(lambda part: part.str.replace(",", "."))
        degrees = numbers.astype(float).to_numpy() @ [1.0, 1.0 / 60.0, 1.0 / 3600.0]
        south = parts[[0, 5]].isin(["S", "W"]).any(axis=1) ^ (parts[1] == "-")
        values = np.where(read, np.where(south, -degrees, degrees), values)
        wrong = wrong & ~read
    return values, wrong, comma


def parted_places(cells: pd.Series) -> tuple[pd.Series, pd.Series]:
    """Return the texts of latitude and longitude of cells that have both, as in `47.1, 9.2`,
    `33°53'59"S 151°12'0"E` or `POINT (9.2 47.1)`.
    """
    texts = texts_of(cells)
    # Of latitude and longitude in one cell.
    both = (
        r"^(?P<lat>[^NSEW]+[NS])[\s,;/]*(?P<lon>[^NSEW]+[EW])$",
        r"^(?P<lat>[NS][^NSEW]+?)[\s,;/]*(?P<lon>[EW][^NSEW]+)$",
        r"^POINT\s*Z?\s*\(\s*(?P<lon>[^\s)]+)\s+(?P<lat>[^\s)]+)",
        r"^[(\[]?(?P<lat>[^\s,;()]+)(?:[,;]\s*|\s+)(?P<lon>[^\s,;()]+)[)\]]?$",
    )
    parts = [texts.str.extract(form) for form in both]
    read = functools.reduce(pd.DataFrame.combine_first, parts)
    return read["lat"], read["lon"]


def parse_times(
    cells: pd.Series,
    dates: pd.Series | None = None,
    unit: str | None = None,
    header: str | None = None,
) -> Times:
    """Parse cells of times, and keep those of a single column of numbers or texts.

    Args:
        cells: of the column of times.
        dates: of a column of dates beside it, for times of day.
        unit: of times, or their format; None recognises it.
        header: unit that the header names.

    Raises:
        ArgumentError: the unit is none.
    """
    form = unit if unit is not None and "%" in unit else None
    if unit is None and header is not None and header.lower() in SECONDS:
        unit = header.lower()
    if form is None and unit is not None and unit not in SECONDS:
        allowed = f"one of {', '.join(SECONDS)}, or a format such as '%d/%m/%Y %H:%M:%S'"
        raise reject("time_unit", unit, allowed)
    if pd.api.types.is_datetime64_any_dtype(cells):
        return _from_dates(_dates(cells), "dates")
    texts = texts_of(cells).str.removesuffix(" UTC")
    texts = texts.str.replace(r"(?<=:\d\d),(?=\d)", ".", regex=True)
    if texts.str.contains(r":\d\d:\d\d\.").any():
        texts = texts.str.replace(r"(:\d\d:\d\d)(?![.\d])", r"\1.0", regex=True)
    if dates is not None and texts.str.match(r"\d{1,2}:\d|\d{5,6}(?:\.\d*)?$").mean() > 0.5:
        times = _formed(texts_of(dates) + " " + texts, form)
        if times.epoch is not None:
            return times._replace(kind=times.kind.replace("dates", "dates and times of day"))
    values, wrong, _ = parse_numbers(cells)
    if form is not None or wrong.mean() > 0.5:
        times = _formed(texts, form)
    else:
        times = (unit is None and _of_clock(texts, values)) or _from_numbers(values, unit)
    return times._replace(cells=cells.to_numpy())


def _of_clock(texts: pd.Series, values: FloatArray) -> Times | None:
    """Return times of day or dates, also with times of day, that are written as numbers such as
    101500.25 or 20260501101500; None of other numbers.
    """
    digits = r"(?:\d{6}|(?:19|20)\d{6}(?:\d{6})?)(?:\.\d+)?"
    # The steps of a clock such as 101559 jump at each minute, of which none has 60 seconds.
    if not texts.str.fullmatch(digits).all():
        return None
    times = _formed(texts)
    uneven = (np.diff(values, n=2) != 0.0).any()
    known = not np.isnan(times.seconds).any()
    return times if known and (uneven or times.epoch is not None) else None


def unwrapped(clock: FloatArray) -> FloatArray:
    """Return times of day [s] as times that go on at midnight."""
    known = ~np.isnan(clock)
    times = clock.copy()
    times[known] = np.unwrap(clock[known], period=DAY)
    return times


def _from_numbers(values: FloatArray, unit: str | None) -> Times:
    """Return times of numbers; without a unit those that are dates of our time in a unit have it,
    and whole numbers with large steps are microseconds or nanoseconds.
    """
    known = values[~np.isnan(values)]
    if not len(known):
        return Times(values, None, "")
    step = np.median(np.diff(np.unique(known), append=np.inf))
    large = unit is None and len(known) >= 20 and step >= 1e4 and not (known % 1.0).any()
    # Dates hours apart are whole minutes; microseconds since a start are not.
    words = ["milliseconds", "microseconds", "nanoseconds"]
    if not large or not (np.diff(known) % 60.0).any():
        words = ["seconds", *words]
    for word in words:
        scale = SECONDS[word]
        # Seconds since 1970 of the years 1990 to 2103.
        dated = 6.3e8 <= np.median(known) * scale <= 4.2e9
        if dated and SECONDS[unit or word] == scale:
            return since_1970(values * scale, f"{word} since 1970")
    if large:
        unit = "us" if step < 1e7 else "ns"
    scale = SECONDS[unit or "s"]
    # Three centuries are no time of a sensor.
    seconds = scale * np.where(np.abs(values) <= 1e10 / scale, values, np.nan)
    return Times(seconds, None, f"in {unit}" if unit not in (None, "s") else "")


def since_1970(seconds: FloatArray, kind: str) -> Times:
    """Return times since the earliest of seconds since 1970, without those of a clock that is
    not set.
    """
    if np.isnan(seconds).all():
        return Times(seconds, None, kind)
    # Nine years from the others a clock is not set.
    far = np.abs(seconds - np.nanquantile(seconds, 0.5, method="lower")) > 3e8
    seconds = np.where(far, np.nan, seconds)
    start = float(np.nanmin(seconds))
    epoch = pd.Timestamp(round(start * 1e6), unit="us").isoformat() + "Z"
    # Dates of our time are exact to less than a microsecond.
    return Times((seconds - start).round(6), epoch, kind)


def _recognised(texts: pd.Series) -> str:
    """Return the format that reads most of the texts; of several ones, that which gives the
    shortest recording that is not in the future.
    """
    sample = texts[texts != ""]
    sample = sample.iloc[:: len(sample) // 200 + 1]
    now = pd.Timestamp.now("UTC")

    def rank(form: str) -> tuple[Any, ...]:
        dates = _dates(sample, form)
        share, last = round(dates.notna().mean(), 1), dates.max()
        return share, last <= now, dates.min() - last, last.year

    marks = set(sample.str.replace(r"\w+", "", regex=True))
    forms = [form for form in FORMS if re.sub(r"%\w", "", form) in marks]
    return max(["ISO8601", *forms], key=rank)


def _dates(cells: pd.Series, form: str | None = None) -> pd.Series:
    """Return the dates of cells, none for those that pandas cannot subtract."""
    dates = pd.to_datetime(cells, format=form, utc=True, errors="coerce")
    return dates.where(dates.dt.year.between(1700, 2200))


def _formed(texts: pd.Series, form: str | None = None) -> Times:
    """Return the times of texts in a format, with or without a date; None recognises it."""
    form = form or _recognised(texts)
    try:
        dates = _dates(texts, form)
    except (ValueError, LookupError, TypeError, OverflowError, re.error) as error:
        raise reject("time_unit", form, f"a format of dates ({error})") from None
    # Of formats without a date.
    first = pd.Timestamp("1900-01-01", tz="UTC")
    if dates.max() < first + pd.Timedelta("1D"):
        clock = (dates - first).dt.total_seconds().to_numpy()
        return Times(unwrapped(clock), None, f"times of day ({form})")
    return _from_dates(dates, "dates" if form == "ISO8601" else f"dates ({form})")


def _from_dates(dates: pd.Series, kind: str) -> Times:
    """Return the seconds since the earliest of dates."""
    seconds = (dates - pd.Timestamp(0, tz="UTC")).dt.total_seconds()
    return since_1970(seconds.to_numpy(), kind)
