"""From cells to numbers, angles and times."""

import functools
import re
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from baselines.recordings.reading.names import SECONDS
from hybrid_env.checks import AnyArray, BoolArray, FloatArray, reject

DAY = 86400.0


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


def parse_numbers(
    cells: pd.Series, thousands: str | None = None
) -> tuple[FloatArray, BoolArray, bool]:
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
        comma = bool(
            texts.str.fullmatch(r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?").any()
            and not texts.str.contains(".", regex=False).any()
        )
        texts = texts.str.replace(",", ".", regex=False) if comma else texts
        numbers = pd.to_numeric(texts, errors="coerce")
        cells = cells.where(texts != "")
    values = numbers.to_numpy(np.float64, na_value=np.nan)
    values = np.where(np.isfinite(values), values, np.nan)
    return values, np.isnan(values) & cells.notna().to_numpy(), comma


def parse_angles(
    cells: pd.Series, thousands: str | None = None
) -> tuple[FloatArray, BoolArray, bool]:
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


def in_degrees(values: FloatArray, semicircles: bool) -> tuple[FloatArray, str]:
    """Return degrees of longitudes and latitudes (n, 2), and how they were understood, "" for
    degrees: as semicircles or whole numbers of 1e-7 degrees, or as degrees and minutes such as
    4730.5.

    Args:
        values: longitudes and latitudes, NaN where there are none.
        semicircles: whether large numbers are semicircles, of which 2^31 are 180 degrees.
    """
    known = np.abs(values[~np.isnan(values).any(axis=1)])
    usual = np.median(known, axis=0).max() if len(known) else 0.0
    if usual > 1e5:
        if semicircles:
            return values * (180.0 / 2**31), "semicircles"
        return values / 1e7, "whole numbers of 1e-7 degrees"
    if usual > 360.0 and (known % 100.0 < 60.0).all():
        degrees, minutes = np.divmod(np.abs(values), 100.0)
        return np.sign(values) * (degrees + minutes / 60.0), "degrees and minutes"
    return values, ""


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
    if unit is not None and unit not in SECONDS and "%" not in unit:
        allowed = f"one of {', '.join(SECONDS)}, or a format such as '%d/%m/%Y %H:%M:%S'"
        raise reject("time_unit", unit, allowed)
    if pd.api.types.is_datetime64_any_dtype(cells):
        return _from_dates(_dates(cells), "dates")
    texts = texts_of(cells).str.removesuffix(" UTC")
    texts = texts.str.replace(r"(:\d\d),(\d)", r"\1.\2", regex=True)
    if dates is not None and texts.str.match(r"\d{1,2}:\d|\d{5,6}(?:\.\d*)?$").mean() > 0.5:
        both = texts_of(dates) + " " + texts
        times = _recognised(both) if unit is None or "%" not in unit else _formed(both, unit)
        if times.epoch is not None:
            return times._replace(kind=times.kind.replace("dates", "dates and times of day"))
    if unit is not None and "%" in unit:
        return _formed(texts, unit)._replace(cells=cells.to_numpy())
    if unit is None and header is not None and header.lower() in SECONDS:
        unit = header.lower()
    return _of_texts(cells, texts, unit)._replace(cells=cells.to_numpy())


def _of_texts(cells: pd.Series, texts: pd.Series, unit: str | None) -> Times:
    """Return the times of numbers in a unit, of clocks without marks, or of texts."""
    values, wrong, _ = parse_numbers(cells)
    if wrong.mean() > 0.5:
        return _recognised(texts)
    # A time of day, or a date, also with a time of day, as a number: 101500.25 or 20260501101500.
    digits = r"(?:\d{6}|(?:19|20)\d{6}(?:\d{6})?)(?:\.\d+)?"
    if unit is None and texts.str.fullmatch(digits).all():
        times = _recognised(texts)
        # The steps of a clock such as 101559 jump at each minute, of which none has 60 seconds.
        uneven = (np.diff(values, n=2) != 0.0).any()
        if (uneven or times.epoch is not None) and not np.isnan(times.seconds).any():
            return times
    return _from_numbers(values, unit)


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
    middle = float(np.median(known))
    step = np.median(np.diff(np.unique(known), append=np.inf))
    large = unit is None and len(known) >= 20 and step >= 1e4 and not (known % 1.0).any()
    # Seconds since 1970 of the years 1990 to 2103.
    first, last = 6.3e8, 4.2e9
    for word in ("seconds", "milliseconds", "microseconds", "nanoseconds"):
        scale = SECONDS[word]
        # Dates hours apart are whole minutes; microseconds since a start are not.
        since_start = word == "seconds" and large and (np.diff(known) % 60.0).any()
        dated = SECONDS[unit or word] == scale and first <= middle * scale <= last
        if dated and not since_start:
            return since_1970(values * scale, f"{word} since 1970")
    if large:
        unit = "us" if step < 1e7 else "ns"
    seconds = SECONDS[unit or "s"] * np.where(np.abs(values) < 1e300, values, np.nan)
    # Three centuries are no time of a sensor.
    seconds[np.abs(seconds) > 1e10] = np.nan
    return Times(seconds, None, f"in {unit}" if unit not in (None, "s") else "")


def since_1970(seconds: FloatArray, kind: str) -> Times:
    """Return times since the earliest of seconds since 1970, without those of a clock that is
    not set.
    """
    known = np.sort(seconds[~np.isnan(seconds)])
    if not len(known):
        return Times(seconds, None, kind)
    # Nine years from the others a clock is not set.
    far = np.abs(seconds - known[(len(known) - 1) // 2]) > 3e8
    seconds = np.where(far, np.nan, seconds)
    start = float(np.nanmin(seconds))
    epoch = pd.Timestamp(round(start * 1e6), unit="us").isoformat() + "Z"
    # Dates of our time are exact to less than a microsecond.
    return Times((seconds - start).round(6), epoch, kind)


def _recognised(texts: pd.Series) -> Times:
    """Return the times of texts in the format that reads most of them; of several ones, that which
    gives the shortest recording that is not in the future.
    """
    if texts.str.contains(r":\d\d:\d\d\.").any():
        texts = texts.str.replace(r"(:\d\d:\d\d)(?![.\d])", r"\1.0", regex=True)
    sample = texts[texts != ""]
    sample = sample.iloc[:: len(sample) // 200 + 1]
    now = pd.Timestamp.now("UTC")

    def rank(form: str) -> tuple[Any, ...]:
        dates = _dates(sample, form)
        share, last = round(dates.notna().mean(), 1), dates.max()
        return share, last <= now, dates.min() - last, last.year

    marks = set(sample.str.replace(r"\w+", "", regex=True))
    forms = [form for form in _forms() if re.sub(r"%\w", "", form) in marks]
    return _formed(texts, max(["ISO8601", *forms], key=rank))


def _forms() -> list[str]:
    """Return the formats that are recognised beside ISO 8601."""
    clocks = ["%H:%M:%S", "%H:%M:%S.%f", "%H:%M", "%H%M%S", "%H%M%S.%f"]
    clocks += ["%I:%M:%S %p", "%I:%M:%S.%f %p", "%I:%M %p"]
    orders = "%d{0}%m{0}%Y", "%m{0}%d{0}%Y", "%d{0}%m{0}%y", "%m{0}%d{0}%y"
    days = [order.format(mark) for order in orders for mark in "/.-"]
    days += ["%d-%b-%Y", "%d %b %Y", "%Y%m%d", "%y%m%d", "%d%m%y"]
    whole = ["%Y%m%d%H%M%S", "%Y%m%d%H%M%S.%f"]
    return [*whole, *clocks, *days, *(f"{day} {clock}" for day in days for clock in clocks)]


def _dates(cells: pd.Series, form: str | None = None) -> pd.Series:
    """Return the dates of cells, none for those that pandas cannot subtract."""
    dates = pd.to_datetime(cells, format=form, utc=True, errors="coerce")
    return dates.where(dates.dt.year.between(1700, 2200))


def _formed(texts: pd.Series, form: str) -> Times:
    """Return the times of texts in a format, with or without a date."""
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
