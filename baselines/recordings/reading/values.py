"""From cells to numbers, angles and times."""

import re
from typing import NamedTuple, TypeAlias

import numpy as np
import pandas as pd

from baselines.recordings.reading.names import SECONDS
from hybrid_env.checks import BoolArray, FloatArray, reject

Cells: TypeAlias = pd.Series

DATE = r"(\d{1,4})[./-](\d{1,2})[./-](\d{1,4})"
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


def texts_of(cells: Cells) -> Cells:
    """Return cells as texts without spaces around them, "" where they are empty."""
    texts = cells.astype(object).where(cells.notna(), "").astype("str").str.strip()
    empty = ["nan", "-nan", "na", "n/a", "#n/a", "null", "none", "<na>", "-", "--", "\\n", "?"]
    return texts.mask(texts.str.lower().isin(empty), "")


def parse_numbers(cells: Cells, thousands: str | None = None) -> tuple[FloatArray, BoolArray, bool]:
    """Parse cells as numbers with a decimal point, or all with a decimal comma.

    Args:
        cells: of a column.
        thousands: mark between thousands, which is removed.

    Returns:
        numbers, NaN where a cell is none; which cells are not empty and no numbers; whether the
        decimal mark is a comma.
    """
    if pd.api.types.is_numeric_dtype(cells) and not pd.api.types.is_bool_dtype(cells):
        values = cells.to_numpy(np.float64, na_value=np.nan)
        return values, np.zeros(len(values), np.bool_), False
    if thousands is None:
        numbers = pd.to_numeric(cells, errors="coerce")
        if not (numbers.isna() & cells.notna()).any() and not np.isinf(numbers).any():
            return numbers.to_numpy(np.float64, na_value=np.nan), np.zeros(len(cells), bool), False
    texts = texts_of(cells)
    if thousands is not None:
        texts = texts.str.replace(thousands, "", regex=False)
    # A decimal comma is one where no cell has a point.
    number = r"[+-]?\d*%s\d+(?:[eE][+-]?\d+)?"
    commas, points = (texts.str.fullmatch(number % mark).any() for mark in (",", r"\."))
    comma = bool(commas and not points)
    if comma:
        texts = texts.str.replace(",", ".", regex=False)
    values = pd.to_numeric(texts, errors="coerce").to_numpy(np.float64, na_value=np.nan)
    values = np.where(np.isfinite(values), values, np.nan)
    return values, np.asarray(np.isnan(values) & (texts != "")), comma


def parse_angles(cells: Cells, thousands: str | None = None) -> tuple[FloatArray, BoolArray, bool]:
    """Parse cells as degrees, as `parse_numbers` does; also with a letter of the hemisphere, and
    with minutes and seconds.
    """
    values, wrong, comma = parse_numbers(cells, thousands)
    if wrong.any():
        angle = (
            r"([NSEW]?)\s*([+-]?)(\d+(?:[.,]\d+)?)\s*°?(?:\s*(\d+(?:[.,]\d+)?)\s*['m])?"
            r"(?:\s*(\d+(?:[.,]\d+)?)\s*(?:\"|''|s))?\s*([NSEW]?)"
        )
        texts = texts_of(cells).str.upper().str.replace("M", "m").str.replace(r"S(?=.)", "s")
        parts = texts.str.extract(f"^{angle}$")
        numbers = parts[[2, 3, 4]].replace(",", ".", regex=True).astype(float).fillna(0.0)
        degrees = (numbers @ [1.0, 1.0 / 60.0, 1.0 / 3600.0]).to_numpy()
        negative = parts[[0, 5]].isin(["S", "W"]).any(axis=1) ^ (parts[1] == "-")
        read = parts[2].notna().to_numpy()
        values = np.where(read, np.where(negative, -degrees, degrees), values)
        wrong = wrong & ~read
    return values, wrong, comma


def in_degrees(values: FloatArray, semicircles: bool) -> FloatArray:
    """Return degrees of longitudes and latitudes (n, 2) in degrees, in 1e-7 degrees or semicircles,
    or in degrees and minutes such as 4730.5.

    Args:
        values: longitudes and latitudes, NaN where there are none.
        semicircles: whether large numbers are semicircles, of which 2^31 are 180 degrees.
    """
    known = np.abs(values[~np.isnan(values).any(axis=1)])
    usual = np.median(known, axis=0).max() if len(known) else 0.0
    if usual > 1e5:
        return values * (180.0 / 2**31 if semicircles else 1e-7)
    if usual > 360.0 and (known % 100.0 < 60.0).all():
        degrees, minutes = np.divmod(np.abs(values), 100.0)
        return np.sign(values) * (degrees + minutes / 60.0)
    return values


def parse_times(
    cells: Cells,
    dates: Cells | None = None,
    unit: str | None = None,
    header: str | None = None,
) -> Times:
    """Parse cells of times.

    Args:
        cells: of the column of times.
        dates: of a column of dates beside it.
        unit: of times, or their format; None recognises it.
        header: unit that the header names.

    Raises:
        ArgumentError: the unit is none.
    """
    if unit is not None and unit not in SECONDS and "%" not in unit:
        allowed = f"one of {', '.join(SECONDS)}, or a format such as '%d/%m/%Y %H:%M:%S'"
        raise reject("time_unit", unit, allowed)
    if unit is None and header is not None and header.lower() in SECONDS:
        unit = header.lower()
    if dates is not None:
        joined = _joined(texts_of(dates), cells)
        if joined is not None:
            return _from_dates(joined, "dates and times of day")
    if pd.api.types.is_datetime64_any_dtype(cells):
        return _from_dates(pd.to_datetime(cells, utc=True), "dates")
    if pd.api.types.is_timedelta64_dtype(cells):
        return Times(cells.dt.total_seconds().to_numpy(), None, "durations")
    if unit is not None and "%" in unit:
        try:
            times = pd.to_datetime(texts_of(cells), format=unit, utc=True, errors="coerce")
        except (ValueError, LookupError, TypeError, OverflowError, re.error) as error:
            raise reject("time_unit", unit, f"a format of dates ({error})") from None
        return _from_dates(times, "dates")
    values, wrong, _ = parse_numbers(cells)
    if wrong.sum() <= 0.5 * len(values):
        return _from_numbers(values, unit)
    texts = texts_of(cells)
    if texts.str.match(r"\d{1,2}:\d").mean() > 0.5:
        return Times(unwrapped(_times_of_day(texts)), None, "times of day")
    return _from_dates(*_parsed_dates(texts))


def unwrapped(clock: FloatArray) -> FloatArray:
    """Return times of day [s] as times that go on at midnight."""
    known = ~np.isnan(clock)
    steps = np.diff(clock[known], prepend=clock[known][:1])
    days = np.cumsum((steps < -0.5 * DAY).astype(int) - (steps > 0.5 * DAY))
    times = clock.copy()
    times[known] += DAY * days
    return times


def _from_numbers(values: FloatArray, unit: str | None) -> Times:
    """Return times of numbers, by their size seconds ... since 1970, of a time of day or of an
    unknown start.
    """
    known = values[~np.isnan(values)]
    if not len(known):
        return Times(values, None, "")
    # The years 1990 to 2103.
    low, high = 6.3e8, 4.2e9
    middle = float(np.median(known))
    for name, word in (
        ("s", "seconds"),
        ("ms", "milliseconds"),
        ("us", "microseconds"),
        ("ns", "nanoseconds"),
    ):
        scale = SECONDS[name]
        if unit in (None, name) and low <= middle * scale <= high:
            seconds = np.where(
                np.abs(values * scale - middle * scale) < 1e9, values * scale, np.nan
            )
            start = np.nanmin(seconds)
            epoch = pd.Timestamp(round(float(start) * 1e6), unit="us").isoformat() + "Z"
            return Times(seconds - start, epoch, f"{word} since 1970")
    clock = clock_seconds(values) if unit is None else None
    if clock is not None:
        return Times(clock, None, "hours, minutes and seconds (HHMMSS)")
    seconds = np.where(np.abs(values) <= 1e18, values * SECONDS[unit or "s"], np.nan)
    return Times(seconds, None, f"in {unit}" if unit not in (None, "s") else "")


def clock_seconds(values: FloatArray) -> FloatArray | None:
    """Return the seconds of numbers that are times of day such as 101559, also after a date, None
    if they are not: minutes and seconds never exceed 59, and the steps, which jump by 40 at each
    minute, are more even without that.
    """
    known = values[~np.isnan(values)]
    days, clock = known // 1e6, known % 1e6
    parts = clock // 1e4, clock // 100.0 % 100.0, clock % 100.0
    if len(known) < 3 or known.min() < 0.0:
        return None
    if any((part >= most).any() for part, most in zip(parts, (24, 60, 60), strict=True)):
        return None
    seconds = 3600.0 * parts[0] + 60.0 * parts[1] + parts[2]
    steps = np.diff(known[np.diff(known, prepend=-1.0) != 0.0])
    clock_steps = np.diff(np.unique(seconds))
    if len(steps) < 2 or len(clock_steps) < 2 or not np.ptp(clock_steps) < np.ptp(steps):
        return None
    if np.ptp(days):
        dates = pd.to_datetime(pd.Series(days.astype(int)).astype("str"), format="%Y%m%d")
        seconds += (dates - dates.min()).dt.total_seconds().to_numpy()
    times = np.full(len(values), np.nan)
    times[~np.isnan(values)] = seconds if np.ptp(days) else unwrapped(seconds)
    return times


def _joined(dates: Cells, cells: Cells) -> "pd.Series[pd.Timestamp] | None":
    """Return dates and times of day of two columns, None if these are no times of day."""
    texts = texts_of(cells)
    if texts.str.match(r"\d{1,2}:\d").mean() > 0.5:
        clock = _times_of_day(texts)
    else:
        numbers, _, _ = parse_numbers(cells)
        hours, rest = np.divmod(numbers, 1e4)
        minutes, seconds = np.divmod(rest, 100.0)
        known = ~np.isnan(numbers)
        if not known.any() or max(hours[known]) > 23 or max(minutes[known]) > 59:
            return None
        clock = 3600.0 * hours + 60.0 * minutes + seconds
    days, _ = _parsed_dates(dates)
    return days + pd.to_timedelta(pd.Series(clock, index=days.index), unit="s")


def _times_of_day(texts: Cells) -> FloatArray:
    """Return seconds after midnight of texts such as 10:15, 10:15:00.5 and 1:15:00 PM."""
    texts = texts.str.replace(",", ".", regex=False)
    parts = texts.str.extract(r"^(\d{1,2}):(\d{2})(?::(\d{2}(?:\.\d*)?))?\s*([AaPp]?)[.Mm]*Z?$")
    hours, minutes, seconds = (parts[k].astype(float) for k in range(3))
    half = parts[3].str.lower()
    hours = hours % 12 + 12 * (half == "p") if half.isin(["a", "p"]).any() else hours
    return (3600.0 * hours + 60.0 * minutes + seconds.fillna(0.0)).to_numpy()


def _parsed_dates(texts: Cells) -> "tuple[pd.Series[pd.Timestamp], str]":
    """Return dates, NaT where a text is none, and how they were understood: ISO 8601; day, month
    and year, or month, day and year, whichever gives the shorter recording; and six or eight
    digits, of which the latest date is taken that is not in the future.
    """

    def parsed(texts: Cells) -> "pd.Series[pd.Timestamp]":
        if texts.str.contains(r"[AaPp]\.?[Mm]", regex=True).any():
            return pd.to_datetime(texts, format="mixed", utc=True, errors="coerce")
        return pd.to_datetime(texts, format="ISO8601", utc=True, errors="coerce")

    texts = texts.str.replace(",", ".", regex=False)
    digits = texts.str.fullmatch(r"\d{5,6}|\d{8}")
    if digits.mean() > 0.5:
        orders = ("%Y%m%d", "%d%m%Y") if texts.str.len().max() == 8 else ("%y%m%d", "%d%m%y")
        texts = texts.str.zfill(6)
        days = [pd.to_datetime(texts, format=order, utc=True, errors="coerce") for order in orders]
        now = pd.Timestamp.now("UTC")
        days.sort(key=lambda day: (day.notna().mean(), day.max() <= now, day.max()))
        return days[-1], "dates"
    if texts.str.match(r"\d{1,2}[./-]\d{1,2}[./-]\d{4}").mean() > 0.5:
        choices = {}
        for word, order in (("day.month.year", r"\2-\1"), ("month/day/year", r"\1-\2")):
            padded = texts.str.replace(r"\b(\d)(?=[./-])", r"0\1", regex=True)
            form = padded.str.replace(r"^(\d+)[./-](\d+)[./-](\d{4})", rf"\3-{order}", regex=True)
            choices[word] = parsed(form)
        word = max(
            choices,
            key=lambda order: (
                round(choices[order].notna().mean(), 1),
                choices[order].min() - choices[order].max(),
            ),
        )
        return choices[word], f"dates ({word})"
    texts = texts.str.replace("/", "-", regex=False).str.replace(r" ?(UTC|GMT)$", "Z", regex=True)
    return parsed(texts), "dates"


def _from_dates(times: "pd.Series[pd.Timestamp]", kind: str) -> Times:
    """Return the seconds since the earliest of dates."""
    start = times.min()
    epoch = None if pd.isna(start) else start.tz_localize(None).isoformat() + "Z"
    return Times((times - start).dt.total_seconds().to_numpy(), epoch, kind)
