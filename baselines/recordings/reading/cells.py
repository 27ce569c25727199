"""The cells of a file as a table, and from cells to numbers and times."""

import re
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import pandas as pd

from baselines.recordings.reading.names import SECONDS, split_unit
from hybrid_env.checks import ArgumentError, FloatArray, IntArray, reject

# Cells without a value.
MISSING = [
    "",
    "nan",
    "NaN",
    "NAN",
    "NA",
    "N/A",
    "n/a",
    "#N/A",
    "null",
    "NULL",
    "None",
    "<NA>",
    "-nan",
]
EPOCH_UNITS = {
    "s": "seconds",
    "ms": "milliseconds",
    "us": "microseconds",
    "ns": "nanoseconds",
}
FORMAT = "a format such as '%d/%m/%Y %H:%M:%S'"


@dataclass(frozen=True, eq=False)
class Table:
    """Cells of a file, before it is known what they mean."""

    # Its path for messages, shortened.
    file: str
    # The cells, one column for each of `names`, labelled by its number from 0.
    frame: pd.DataFrame
    # Of the columns as in the file; empty for a column without a name.
    names: tuple[str, ...]
    # Whether the file names its columns.
    headed: bool = True
    # What a row is called in messages: line, row or point.
    row_word: str = "row"
    # Number of the first row in messages.
    first_row: int = 1
    # (n,) number of the segment of a GPX track of each row.
    segments: IntArray | None = None
    # What was left out or assumed, for the summary.
    notes: list[str] = field(default_factory=list)

    def place(self, row: int, column: int) -> str:
        """Return file, row and column for a message; row and column are counted from 0."""
        return f"{self.file}, {self.row_word} {row + self.first_row}: {self.label(column)}"

    def label(self, column: int) -> str:
        """Return the name of a column for a message."""
        return self.names[column] or f"column {column + 1}"

    def labels(self, columns: list[int]) -> str:
        """Return the names of columns for a message."""
        return " and ".join(repr(self.label(column)) for column in columns)


class Numbers(NamedTuple):
    """Cells of a column as numbers."""

    # (n,) NaN where a cell is empty, and where it is not a number.
    values: FloatArray
    # Rows whose cell is neither a number nor empty.
    wrong: IntArray
    # Whether the decimal separator is a comma.
    comma: bool = False


class Times(NamedTuple):
    """Times of all rows of a file."""

    # (n,) [s]; dates are counted from the earliest one.
    seconds: FloatArray
    # Date of time 0, ISO 8601; None for times without a date.
    epoch: str | None
    # How the cells were understood, for the summary.
    kind: str
    # Or `ticks` for numbers of rows.
    unit: str = "s"


def counted(number: int, word: str) -> str:
    """Return a number and a word, in the plural if need be."""
    return f"{number:,} {word}" + ("" if number == 1 else "s")


def parse_numbers(cells: "pd.Series[object]") -> Numbers:
    """Parse cells as numbers with a decimal point, or all with a decimal comma."""
    decimal_comma = r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?"
    if pd.api.types.is_bool_dtype(cells) or pd.api.types.is_datetime64_any_dtype(cells):
        return Numbers(np.full(len(cells), np.nan), np.arange(len(cells)))
    if pd.api.types.is_numeric_dtype(cells):
        return Numbers(cells.to_numpy(np.float64, na_value=np.nan), np.empty(0, np.int64))
    texts = cells.astype("str").str.strip()
    empty = (cells.isna() | texts.isin(MISSING)).to_numpy()
    values = np.array(pd.to_numeric(texts, errors="coerce"), np.float64)
    wrong = np.isnan(values) & ~empty
    commas = texts[wrong].str.fullmatch(decimal_comma)
    if (
        wrong.any()
        and commas.all()
        and not texts[~wrong & ~empty].str.contains(".", regex=False).any()
    ):
        values[wrong] = pd.to_numeric(texts[wrong].str.replace(",", "."), errors="coerce")
        return Numbers(values, np.empty(0, np.int64), comma=True)
    return Numbers(values, np.flatnonzero(wrong))


def parse_times(table: Table, column: int, unit: str | None) -> Times:
    """Parse a column of times; a unit or format of None is recognised."""
    if unit is not None and unit not in SECONDS and "%" not in unit:
        raise reject("time_unit", unit, f"one of {', '.join(SECONDS)}, or {FORMAT}")
    cells = table.frame[column]
    epoch = None
    types = pd.api.types
    dated = types.is_datetime64_any_dtype(cells) or types.is_timedelta64_dtype(cells)
    if dated or (unit is not None and "%" in unit):
        times, kind = _from_dates(cells, unit)
    else:
        numbers = parse_numbers(cells)
        if not numbers.wrong.size:
            return _from_numbers(table, column, numbers.values, unit)
        # A broken number among numbers.
        broken = len(numbers.wrong) < len(cells) / 2
        times, kind = (pd.Series(numbers.values), "") if broken else _from_dates(cells, None)
    if types.is_datetime64_any_dtype(times):
        start = times.min()
        epoch = None if pd.isna(start) else start.tz_localize(None).isoformat() + "Z"
        times = times - start
    if types.is_timedelta64_dtype(times):
        times = times.dt.total_seconds()
    seconds = times.to_numpy(np.float64)
    _check_times(table, column, seconds)
    return Times(seconds, epoch, kind)


def epoch_unit(values: FloatArray) -> str | None:
    """Return the unit of times since 1970, None if the times are not of the years 1990 to 2103."""
    # [s] since 1970: the years 1990 to 2103.
    epoch = (6.3e8, 4.2e9)
    for unit in EPOCH_UNITS:
        low, high = (bound / SECONDS[unit] for bound in epoch)
        if values.min() >= low and values.max() <= high:
            return unit
    return None


def _from_numbers(table: Table, column: int, values: FloatArray, unit: str | None) -> Times:
    """Seconds of numbers; a unit of None is that of the header."""
    if unit is None:
        unit = split_unit(table.names[column])[1]
        # Time scales stand where a unit may stand.
        if unit is not None and unit.lower() in ("utc", "gmt", "unix", "epoch", "posix", "gps"):
            unit = None
    if unit is not None and unit.lower() not in SECONDS:
        name = f"{table.file}: unit of {table.label(column)}"
        raise reject(name, unit, f"one of {', '.join(SECONDS)}: see --time-unit")
    _check_times(table, column, values)
    clock = _clock_seconds(values) if unit is None else None
    if clock is not None:
        # A date stands before the time of day.
        if np.ptp(values // 1e6):
            allowed = "--time-unit with a format such as '%Y%m%d%H%M%S'"
            raise reject(
                f"{table.file}: {table.label(column)}",
                table.frame[column].iloc[0],
                allowed,
            )
        return Times(clock, None, "hours, minutes and seconds (HHMMSS)")
    since_1970 = epoch_unit(values)
    if since_1970 is None or unit not in (None, since_1970):
        scale = SECONDS[unit.lower()] if unit else 1.0
        return Times(values * scale, None, f"in {unit}" if unit not in (None, "s") else "")
    cells = table.frame[column]
    # Nanoseconds since 1970 need more than the 53 bits of a float.
    exact = cells if pd.api.types.is_integer_dtype(cells) else pd.Series(values)
    start = exact.min()
    seconds = (exact - start).to_numpy(np.float64) * SECONDS[since_1970]
    date = pd.Timestamp(start, unit=since_1970)
    return Times(seconds, f"{date.isoformat()}Z", f"{EPOCH_UNITS[since_1970]} since 1970")


def _clock_seconds(values: FloatArray) -> FloatArray | None:
    """Return the seconds of numbers that are times of day such as 101559, None if they are not:
    minutes and seconds never exceed 59, and the steps, which jump by 40 at each minute, are more
    even without that.
    """
    hours = values // 1e4 % 100
    minutes = values // 100 % 100
    seconds = values % 100
    if values.min() < 0.0 or hours.max() > 23 or minutes.max() > 59 or seconds.max() >= 60.0:
        return None
    clock = 3600.0 * hours + 60.0 * minutes + seconds
    steps = np.diff(values[np.diff(values, prepend=-1.0) != 0.0])
    clock_steps = np.diff(np.unique(clock))
    if len(steps) < 2 or len(clock_steps) < 2 or not np.ptp(clock_steps) < np.ptp(steps):
        return None
    return clock


def _from_dates(cells: "pd.Series[object]", form: str | None) -> "tuple[pd.Series[object], str]":
    """Dates, durations or times of day of cells, NaT where they are none, and how they were
    understood.
    """
    german = r"(\d{2})\.(\d{2})\.(\d{4})(.*)"
    if pd.api.types.is_timedelta64_dtype(cells):
        return cells, "durations"
    if pd.api.types.is_datetime64_any_dtype(cells):
        return pd.to_datetime(cells, utc=True), "dates"
    texts = cells.astype("str").str.strip()
    kind = "dates"
    if form is not None:
        try:
            return pd.to_datetime(texts, format=form, utc=True, errors="coerce"), kind
        except (ValueError, LookupError, TypeError, OverflowError, re.error) as error:
            # Of the pattern that it becomes.
            raise reject("time_unit", form, f"a format of dates ({error})") from None
    first, texts = str(texts.iloc[0]), texts.str.replace(",", ".")
    if first.count(":") == 2 and first.find(":") <= 2:
        return pd.to_timedelta(texts, errors="coerce"), "times of day"
    if first.count(".") >= 2 and texts.str.fullmatch(german).all():
        texts, kind = texts.str.replace(german, r"\3-\2-\1\4", regex=True), "dates (day.month.year)"
    return pd.to_datetime(texts, format="ISO8601", utc=True, errors="coerce"), kind


def _check_times(table: Table, column: int, seconds: FloatArray) -> None:
    """Check that every cell is a time: none is NaN, infinite or of an absurd size."""
    # [s]
    wrong = np.flatnonzero(~(np.abs(seconds) <= 1e21))
    if not wrong.size:
        return
    row = int(wrong[0])
    cell = table.frame[column].iloc[row]
    if pd.isna(cell) or not str(cell).strip():
        raise ArgumentError(
            f"{table.place(row, column)}: the cell is empty: expected a time in every row"
        )
    raise reject(
        table.place(row, column),
        str(cell),
        f"a number, an ISO date, or --time-unit with {FORMAT}",
    )
