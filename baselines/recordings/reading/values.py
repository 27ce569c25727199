"""From cells to numbers, angles and times."""

import re
from typing import NamedTuple, TypeAlias

import numpy as np
import pandas as pd
from pandas.tseries.api import guess_datetime_format

from baselines.recordings.reading.names import SECONDS
from hybrid_env.checks import AnyArray, BoolArray, FloatArray, reject

Cells: TypeAlias = pd.Series

DAY = 86400.0
# Seconds since 1970 of the years 1990 to 2103.
YEARS = 6.3e8, 4.2e9
# Nine years from the others a clock is not set.
FAR_CLOCK = 3e8
# Day 0 of 1970 in calendars that count days.
DAYS = {"Excel": 25_569.0, "modified Julian": 40_587.0, "Matlab": 719_529.0, "Julian": 2_440_587.5}
# Year to second, and a fraction of it.
STAMP = r"((?:19|20)\d{6})(\d{6})(\d{0,3})"
WEEKDAY = r"(?:(?i:mon|tue|wed|thu|fri|sat|sun)[a-z]*\.?,? )"

DATE_FORMS = {
    # A zone that is not converted.
    r"(?<=\d) ?\(?[A-Z]{3,5}\)?$": "",
    r"(?<=\d),(?=\d)": ".",
    rf"^{WEEKDAY}": "",
    r" ?(UTC|GMT)(?=[+-]\d)": "",
    STAMP: r"\1T\2.\3",
    r"^((?:19|20)\d\d)(0\d|1[012])(\d\d)$": r"\1-\2-\3",
    r"^(\d{5})$": r"0\1",
    r"^(\d\d)(\d\d)(\d{4}|\d\d)$": r"\1-\2-\3",
    r"^(\d{4})[:/](\d\d)[:/](\d\d)\b": r"\1-\2-\3",
    r" (?=\d:)": " 0",
    r"(?<=\d) ?([AaPp])\.?[Mm]\.?$": r" \1M",
}
"""Patterns of dates, in the order in which they are replaced, and what they become."""


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
    texts = texts.str.replace(r"(?<=\d)[\s'\u2019](?=\d{3}(?:\D|$))", "", regex=True)
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
    """Parse cells as degrees, as `parse_numbers` does; also with a letter or word of the
    hemisphere, and with minutes and seconds.
    """
    values, wrong, comma = parse_numbers(cells, thousands)
    if wrong.any():
        # The last letter of "47d15m30s" is no hemisphere.
        texts = texts_of(cells).str.replace(r"(\d.*[dm'\u2032].*\d)\s*s$", r"\1", regex=True)
        letters = texts.str.upper().str.extract(r"^([NSEW])|([NSEW])[A-Z]*\W*$")
        marks = r"(?i:north|south|east|west|deg|min|sec)|[NSEWdms°º:'\u2019\u2032\"\u201d\u2033]"
        bare = texts.str.replace(marks, " ", regex=True).str.strip()
        bare = bare.str.replace(r"(?<=\d),(?=\d)", ".", regex=True)
        number = r"(\d+(?:\.\d+)?)"
        parts = bare.str.extract(rf"^([+-]?)\s*{number}(?:\s+{number})?(?:\s+{number})?$")
        numbers = parts[[1, 2, 3]].astype(float).fillna(0.0)
        degrees = (numbers @ [1.0, 1.0 / 60.0, 1.0 / 3600.0]).to_numpy()
        negative = letters.isin(["S", "W"]).any(axis=1) ^ (parts[0] == "-")
        read = parts[1].notna().to_numpy()
        values = np.where(read, np.where(negative, -degrees, degrees), values)
        wrong = wrong & ~read
    return values, wrong, comma


def in_degrees(values: FloatArray, semicircles: bool) -> tuple[FloatArray, str]:
    """Return degrees of longitudes and latitudes (n, 2), and how they were understood, "" for
    degrees: as semicircles, as degrees and minutes such as 4730.5, or as whole numbers of the
    largest of 1e-7, 1e-6 and 1e-5 degrees that gives places on Earth.

    Args:
        values: longitudes and latitudes, NaN where there are none.
        semicircles: whether large numbers are semicircles, of which 2^31 are 180 degrees.
    """
    known = np.abs(values[~np.isnan(values).any(axis=1)])
    usual = np.median(known, axis=0).max() if len(known) else 0.0
    if usual > 1e5:
        if semicircles:
            return values * (180.0 / 2**31), "semicircles"
        digits = next(k for k in (5, 6, 7) if usual <= 360.0 * 10.0**k or k == 7)
        return values / 10.0**digits, f"whole numbers of 1e-{digits} degrees"
    if usual > 360.0 and (known % 100.0 < 60.0).all():
        degrees, minutes = np.divmod(np.abs(values), 100.0)
        return np.sign(values) * (degrees + minutes / 60.0), "degrees and minutes"
    return values, ""


def parse_times(
    cells: Cells, dates: Cells | None = None, unit: str | None = None, header: str | None = None
) -> Times:
    """Parse cells of times.

    Args:
        cells: of the column of times.
        dates: of a column of dates beside it, or of GPS weeks.
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
        days, _, _ = parse_numbers(dates)
        if 0.0 <= np.nanmax(days, initial=-1.0) < 1e4:
            return _from_weeks(days, parse_numbers(cells)[0] * SECONDS[unit or "s"])
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
    stamps = np.nan_to_num(values).max(initial=0.0) > 1e13 and unit is None
    if wrong.sum() <= 0.5 * len(values) and not (
        stamps and cells.astype("str").str.fullmatch(STAMP).mean() > 0.5
    ):
        return _from_numbers(values, unit)
    texts = texts_of(cells)
    if _are_clocks(texts):
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
    """Return times of numbers, by their size seconds ... or days of a calendar, of a time of day
    or of an unknown start.
    """
    known = values[~np.isnan(values)]
    if not len(known):
        return Times(values, None, "")
    low, high = YEARS
    middle = float(np.median(known))
    for name, word in (
        ("s", "seconds"),
        ("ms", "milliseconds"),
        ("us", "microseconds"),
        ("ns", "nanoseconds"),
    ):
        scale = SECONDS[name]
        if unit in (None, name) and low <= middle * scale <= high:
            return since_1970(values * scale, f"{word} since 1970")
    if unit is None:
        for word, origin in DAYS.items():
            seconds = (values - origin) * DAY
            if low <= np.median((known - origin) * DAY) <= high and _are_days(known):
                return since_1970(np.round(seconds, 3), f"days ({word})")
    clock = clock_seconds(values) if unit is None else None
    if clock is not None:
        return Times(clock, None, "hours, minutes and seconds (HHMMSS)")
    step = np.median(np.diff(np.unique(known), append=np.inf))
    if unit is None and len(known) >= 20 and step >= 1e4 and not (known % 1.0).any():
        unit = "us" if step < 1e7 else "ns"
    seconds = np.where(np.abs(values) <= 1e18, values * SECONDS[unit or "s"], np.nan)
    return Times(seconds, None, f"in {unit}" if unit not in (None, "s") else "")


def _are_days(values: FloatArray) -> bool:
    """Whether the steps of times are, in days, less than 40 seconds, or minutes of which an hour
    has a whole number.
    """
    minutes = 1440.0 * float(np.median(np.diff(np.unique(values), append=np.inf)))
    nearest = round(min(minutes, 61.0))
    return minutes < 0.7 or (60 % nearest == 0 and abs(minutes - nearest) < 1e-3 * minutes)


def _from_weeks(weeks: FloatArray, seconds: FloatArray) -> Times:
    """Return times of GPS weeks and seconds of the week."""
    leap_seconds = 18.0
    start = pd.Timestamp("1980-01-06").timestamp() - leap_seconds
    return since_1970(start + 7.0 * DAY * weeks + seconds, "GPS weeks and seconds")


def since_1970(seconds: FloatArray, kind: str) -> Times:
    """Return times since the earliest of seconds since 1970, without those of a clock that is
    not set.
    """
    known = np.sort(seconds[~np.isnan(seconds)])
    if not len(known):
        return Times(seconds, None, kind)
    far = np.abs(seconds - known[(len(known) - 1) // 2]) > FAR_CLOCK
    seconds = np.where(far, np.nan, seconds)
    start = float(np.nanmin(seconds))
    epoch = pd.Timestamp(round(start * 1e6), unit="us").isoformat() + "Z"
    # Dates of our time are exact to less than a microsecond.
    return Times((seconds - start).round(6), epoch, kind)


def clock_seconds(values: FloatArray) -> FloatArray | None:
    """Return the seconds of numbers that are times of day such as 101559, None if they are not:
    minutes and seconds never exceed 59, and the steps, which jump by 40 at each minute, are more
    even without that.
    """
    known = values[~np.isnan(values)]
    hours, rest = np.divmod(values, 1e4)
    minutes, seconds = np.divmod(rest, 100.0)
    if len(known) < 10 or known.min() < 0.0 or known.max() >= 24e4:
        return None
    if np.nanmax(minutes) >= 60.0 or np.nanmax(seconds) >= 60.0:
        return None
    clock = 3600.0 * hours + 60.0 * minutes + seconds
    steps = np.diff(known[np.diff(known, prepend=-1.0) != 0.0])
    clock_steps = np.diff(np.unique(clock[~np.isnan(clock)]))
    if len(steps) < 2 or len(clock_steps) < 2 or not np.ptp(clock_steps) < np.ptp(steps):
        return None
    return unwrapped(clock)


def _joined(dates: Cells, cells: Cells) -> "pd.Series[pd.Timestamp] | None":
    """Return dates and times of day of two columns, None if these are no times of day."""
    texts = texts_of(cells)
    if _are_clocks(texts):
        clock = _times_of_day(texts)
    else:
        numbers, _, _ = parse_numbers(cells)
        if not 0.0 <= np.nanmax(numbers, initial=-1.0) < 24e4:
            return None
        clock = numbers - 40.0 * (numbers // 100.0) - 2400.0 * (numbers // 1e4)
    days, _ = _parsed_dates(dates)
    if days.isna().mean() > 0.5:
        return None
    return days.dt.normalize() + pd.to_timedelta(pd.Series(clock, index=days.index), unit="s")


def _are_clocks(texts: Cells) -> bool:
    """Whether most texts are times of day or durations."""
    return bool(texts.str.match(rf"(?:{WEEKDAY}|\d+ days?,? )?\d{{1,2}}:\d").mean() > 0.5)


def _times_of_day(texts: Cells) -> FloatArray:
    """Return seconds after midnight of texts such as 10:15, 10:15:00.5, 1:15:00 PM, 0 days
    10:15:00, and of minutes and seconds such as 00:15.5.
    """
    texts = texts.str.replace(",", ".", regex=False)
    short = texts.str.fullmatch(r"\d+:\d\d(\.\d+)?")
    if short.all() and (texts.str.contains(".", regex=False).any() or texts.iloc[0] == "00:00"):
        texts = "0:" + texts
    parts = texts.str.extract(
        rf"^(?:{WEEKDAY})?(?:(\d+) days? )?(\d{{1,2}}):(\d\d)(?::(\d\d)(?:[.:](\d*))?)?"
        r"\s*([AaPp]?)[.Mm]*Z?$"
    )
    days, hours, minutes, seconds = (parts[k].astype(float) for k in range(4))
    fraction = ("0." + parts[4].fillna("0")).astype(float)
    half = parts[5].str.lower()
    hours = hours % 12 + 12 * (half == "p") if half.isin(["a", "p"]).any() else hours
    clock = 60.0 * (60.0 * hours + minutes) + seconds.fillna(0.0) + fraction
    return (DAY * days.fillna(0.0) + clock).to_numpy()


def _parsed_dates(texts: Cells) -> "tuple[pd.Series[pd.Timestamp], str]":
    """Return dates, NaT where a text is none, and how they were understood: ISO 8601; day, month
    and year in any order, also without marks between them, which gives the shortest recording and
    is not in the future; and what pandas understands.
    """
    if texts.str.match(r"(?:19|20)\d\d-").all():
        iso = pd.to_datetime(texts, format="ISO8601", utc=True, errors="coerce")
        if iso.notna().mean() > 0.9:
            return iso, "dates"
    zones = texts.str.extract(r"(?<=\d) ?\(?([A-Z]{3,5})\)?$")[0]
    named = ", ".join(sorted(set(zones.dropna()) - {"UTC", "GMT"})[:2])
    kind = f"dates in {named}, which is not converted" if named else "dates"
    sample = texts.iloc[:: max(1, len(texts) // 500)].tolist()
    for pattern, form in DATE_FORMS.items():
        if any(re.search(pattern, text) for text in sample):
            texts = texts.str.replace(pattern, form, regex=True)
            sample = [re.sub(pattern, form, text) for text in sample]
    half = texts.str.extract(r" ([AaPp])M$")[0].str.lower()
    texts = texts.str.replace(r" [AaPp]M$", "", regex=True)
    day = r"(\d\d?)[./-](\d\d?)[./-](\d{4}|\d\d)\b"
    forms = {kind: texts}
    if texts.str.match(day).mean() > 0.5:
        texts = texts.str.replace(r"\b(\d)(?=[./-])", r"0\1", regex=True)
        orders = {"day.month.year": r"\3-\2-\1", "month/day/year": r"\3-\1-\2"}
        if not texts.str.match(r"\d\d.\d\d.\d{4}").any():
            orders["year-month-day"] = r"\1-\2-\3"
        forms = {
            f"{kind} ({word})": texts.str.replace(f"^{day}", order, regex=True)
            for word, order in orders.items()
        }
    dates = {}
    now = pd.Timestamp.now("UTC")
    for word, form in forms.items():
        full = form.str.replace(r"^(\d\d)(?=-\d\d-\d\d\b)", r"20\1", regex=True)
        found = pd.to_datetime(full, format="ISO8601", utc=True, errors="coerce").dt.as_unit("us")
        # Names of months.
        rest = found.isna() & (form != "") & form.str.contains(r"\d.*[A-Za-z ]")
        if rest.any():
            pattern = guess_datetime_format(full[rest].iloc[0])
            # It takes long for texts of different forms.
            rest &= (pattern is not None) | (rest.cumsum() <= 10_000)
            other = pd.to_datetime(full[rest], format=pattern or "mixed", utc=True, errors="coerce")
            found = found.where(~rest, other.dt.as_unit("us").reindex(found.index))
        twelve = (half == "p").astype(int) - (half.notna() & (found.dt.hour == 12)).astype(int)
        dates[word] = found + pd.to_timedelta(12 * twelve, unit="h")
    word = max(
        dates,
        key=lambda word: (
            round(dates[word].notna().mean(), 1),
            dates[word].max() <= now,
            dates[word].min() - dates[word].max(),
            dates[word].max().year,
        ),
    )
    return dates[word], word


def _from_dates(times: "pd.Series[pd.Timestamp]", kind: str) -> Times:
    """Return the seconds since the earliest of dates."""
    if times.notna().any():
        start = times.median()
        seconds = (times - start).dt.total_seconds()
        return since_1970(seconds.to_numpy() + start.timestamp(), kind)
    return Times(np.full(len(times), np.nan), None, kind)
