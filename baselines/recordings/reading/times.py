"""From cells to times: seconds, dates, and seconds or milliseconds since 1970."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from baselines.recordings.reading.names import SECONDS, split_unit
from baselines.recordings.reading.numbers import parse_numbers
from baselines.recordings.reading.table import Table
from hybrid_env.checks import ArgumentError, reject

MAX_TIME = 1e12  # [s]
EPOCH = (6.3e8, 4.2e9)  # [s] since 1970: the years 1990 to 2103
SCALES = ("utc", "gmt", "unix", "epoch", "posix", "gps")
"""Time scales that stand where a unit may stand."""

EPOCH_UNITS = ("s", "ms", "us", "ns")
GERMAN = r"(\d{2})\.(\d{2})\.(\d{4})(.*)"
ALLOWED = "a number, an ISO date, or --time-unit with a format such as '%d/%m/%Y %H:%M:%S'"


@dataclass(frozen=True, eq=False)
class Times:
    """Times of all rows of a file.

    Attributes:
        seconds: (n,) times [s]; dates are counted from the earliest one.
        epoch: date of time 0, ISO 8601; None for times without a date.
        kind: how the cells were understood, for the summary.
        unit: `s`, or `ticks` for numbers of rows.
    """

    seconds: NDArray[np.float64]
    epoch: str | None
    kind: str
    unit: str = "s"


def parse_times(table: Table, column: int, unit: str | None) -> Times:
    """Parse a column of times.

    Args:
        table: the table.
        column: number of the column from 0.
        unit: unit or format; None recognises it.

    Raises:
        ArgumentError: a cell is not a time.
    """
    cells = table.frame[column]
    if unit is not None and unit not in SECONDS and "%" not in unit:
        raise reject(
            "time_unit", unit, f"one of {', '.join(SECONDS)}, or a format such as '%d/%m/%Y %H:%M:%S'"
        )
    if pd.api.types.is_timedelta64_dtype(cells):
        return _checked(table, column, cells, cells.dt.total_seconds().to_numpy(), None, "durations")
    if pd.api.types.is_datetime64_any_dtype(cells):
        return _dates(table, column, cells, pd.to_datetime(cells, utc=True), "dates")
    numbers = parse_numbers(cells)
    if not numbers.wrong.size and not (unit and "%" in unit):
        return _numbers(table, column, cells, numbers.values, unit)
    texts = cells.astype("str").str.strip()
    if unit is not None and "%" in unit:
        try:
            dates = pd.to_datetime(texts, format=unit, utc=True, errors="coerce")
        except ValueError as error:
            raise reject("time_unit", unit, f"a format of dates ({error})") from None
        return _dates(table, column, cells, dates, "dates")
    if len(numbers.wrong) < len(cells) / 2:  # a broken number among numbers
        return _checked(table, column, cells, numbers.values, None, "")
    if texts.iloc[0].count(".") >= 2 and texts.str.fullmatch(GERMAN).all():
        ordered = texts.str.replace(",", ".").str.replace(GERMAN, r"\3-\2-\1\4", regex=True)
        dates = pd.to_datetime(ordered, format="ISO8601", utc=True, errors="coerce")
        return _dates(table, column, cells, dates, "dates (day.month.year)")
    if texts.iloc[0].count(":") == 2 and texts.iloc[0].find(":") <= 2:
        clock = pd.to_timedelta(texts.str.replace(",", "."), errors="coerce").dt.total_seconds()
        return _checked(table, column, cells, clock.to_numpy(), None, "times of day")
    dates = pd.to_datetime(texts.str.replace(",", "."), format="ISO8601", utc=True, errors="coerce")
    return _dates(table, column, cells, dates, "dates")


def _numbers(
    table: Table, column: int, cells: "pd.Series[object]", values: NDArray[np.float64], unit: str | None
) -> Times:
    if unit is None:
        unit = split_unit(table.names[column])[1]
        unit = None if unit is not None and unit.lower() in SCALES else unit
    if unit is not None and unit.lower() not in SECONDS:
        raise reject(
            f"{table.file}: unit of {table.label(column)}",
            unit,
            f"one of {', '.join(SECONDS)}: see --time-unit",
        )
    _checked(table, column, cells, values, None, "")
    since_1970 = epoch_unit(values)
    if since_1970 is not None and unit in (None, since_1970):
        start = values.min()
        if pd.api.types.is_integer_dtype(cells):  # nanoseconds since 1970 need more than 53 bits
            start = cells.min()
            values = (cells - start).to_numpy(np.float64)
        else:
            values = values - start
        date = pd.Timestamp(start, unit=since_1970)
        kind = {"s": "seconds", "ms": "milliseconds", "us": "microseconds", "ns": "nanoseconds"}[since_1970]
        return Times(values * SECONDS[since_1970], f"{date.isoformat()}Z", f"{kind} since 1970")
    scale = SECONDS[unit.lower()] if unit else 1.0
    return Times(values * scale, None, f"in {unit}" if unit not in (None, "s") else "")


def epoch_unit(values: NDArray[np.float64]) -> str | None:
    """Return the unit of times since 1970, None if the times are not of the years 1990 to 2103."""
    for unit in EPOCH_UNITS:
        low, high = (bound / SECONDS[unit] for bound in EPOCH)
        if values.min() >= low and values.max() <= high:
            return unit
    return None


def _dates(
    table: Table, column: int, cells: "pd.Series[object]", dates: "pd.Series[pd.Timestamp]", kind: str
) -> Times:
    start = dates.min()
    seconds = (dates - start).dt.total_seconds().to_numpy()
    epoch = None if pd.isna(start) else start.tz_localize(None).isoformat() + "Z"
    return _checked(table, column, cells, seconds, epoch, kind)


def _checked(
    table: Table,
    column: int,
    cells: "pd.Series[object]",
    seconds: NDArray[np.float64],
    epoch: str | None,
    kind: str,
) -> Times:
    wrong = np.flatnonzero(~(np.abs(seconds) <= MAX_TIME / 1e-9))
    if wrong.size:
        row = int(wrong[0])
        place = f"{table.place(row)}: {table.label(column)}"
        if pd.isna(cells.iloc[row]) or not str(cells.iloc[row]).strip():
            raise ArgumentError(f"{place}: the cell is empty: expected a time in every row")
        raise reject(place, str(cells.iloc[row]), ALLOWED)
    return Times(seconds, epoch, kind)
