"""Reading a file of recorded positions: CSV, TSV, Parquet or GPX, also compressed by gzip."""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from baselines.recordings.reading.columns import Columns, find_columns
from baselines.recordings.reading.files import read_table
from baselines.recordings.reading.numbers import parse_numbers
from baselines.recordings.reading.objects import unmarked_objects
from baselines.recordings.reading.positions import read_positions
from baselines.recordings.reading.summary import summarise
from baselines.recordings.reading.table import Table, counted
from baselines.recordings.reading.times import Times, parse_times
from baselines.recordings.recording import UNKNOWN_UNIT, Recording, make_recording, tick_times
from hybrid_env.checks import ArgumentError, check_positive, reject

TAU_TOLERANCE = 1e-3
"""Largest relative difference between a given tick and the one of the times."""

MAX_NAME = 60  # characters of an object's name


@dataclass(frozen=True, eq=False)
class RecordingFile:
    """What was read of a file.

    Attributes:
        recordings: one for each object, in the order in which they appear in the file.
        summary: one line that says what was read and what was left out.
    """

    recordings: tuple[Recording, ...]
    summary: str


def read_recordings(
    path: str | os.PathLike[str],
    *,
    columns: Mapping[str, str] | None = None,
    object_column: str | None = None,
    unit: str | None = None,
    time_unit: str | None = None,
    tau: float | None = None,
    gap: float | None = None,
) -> RecordingFile:
    """Read the recordings of a file.

    Args:
        path: the file.
        columns: name or number (from 1) of the column of each of `time`, `x`, `y`, `lat`, `lon`; None finds
            them by their names.
        object_column: column that tells several objects apart; `none` for a file with one object; None finds
            it by its name.
        unit: unit of x and y; `deg` for longitude and latitude; None takes it from the header.
        time_unit: unit of the times: s, ms, us, ns, min, h, or a format such as `%d/%m/%Y %H:%M:%S`; None
            recognises ISO dates and seconds, milliseconds ... since 1970, and otherwise means seconds.
        tau: duration of a tick [s] of a file without times; None counts time in ticks.
        gap: longest time between two measurements of one piece [s]; None is 20 nominal ticks.

    Raises:
        ArgumentError: the file cannot be read, or it is not clear what its columns mean; the message names
            file, line, value and what is allowed, or the option that helps.
    """
    if tau is not None:
        check_positive("tau", tau)
    if gap is not None:
        check_positive("gap", gap)
    table = read_table(path)
    found = find_columns(table, columns, object_column)
    groups = _groups(table, found.object, Path(path))
    times = _times(table, found, time_unit, tau, len(groups) == 1)
    places = read_positions(table, found, unit)
    recordings, few = [], 0
    for name, rows in groups:
        measured = rows[places.measured[rows]]
        if len(measured) < 2 and len(groups) > 1:
            few += 1
            continue
        if len(measured) < 2:
            found_positions = counted(len(measured), "measured position")
            raise ArgumentError(f"{table.file}: {found_positions}: expected at least two")
        _check_order(table, found, times.seconds, rows, name if found.object is not None else None)
        if object_column is None and len(groups) == 1:
            _check_one_object(table, times.seconds[measured], places.values[measured])
        places.check_unit(table, times.seconds[measured], measured)
        positions, projection = places.plane(rows)
        recordings.append(
            make_recording(
                times.seconds[rows], positions, name=name, gap=gap, breaks=_breaks(table, rows),
                unit=places.unit or UNKNOWN_UNIT, time_unit=times.unit, epoch=times.epoch,
                projection=projection,
            )
        )  # fmt: skip
    if not recordings:
        raise ArgumentError(f"{table.file}: no object has two measured positions")
    if few:
        table.notes.append(f"{counted(few, 'object')} with fewer than two measurements left out")
    if tau is not None and "time" in found.roles:
        _check_tau(tau, recordings[0])
    return RecordingFile(tuple(recordings), summarise(table, found, times, recordings))


def _groups(table: Table, column: int | None, path: Path) -> list[tuple[str, NDArray[np.int64]]]:
    """Names of the objects and their rows."""
    if column is None:
        stem = path.name.removesuffix(".gz")
        return [(Path(stem).stem or stem, np.arange(len(table.frame)))]
    cells = table.frame[column]
    empty = np.flatnonzero(cells.isna())
    if empty.size:
        raise ArgumentError(
            f"{table.place(int(empty[0]))}: {table.label(column)}: the cell is empty: expected an object in "
            "every row, or --object none"
        )
    codes, values = pd.factorize(cells)
    order = np.argsort(codes, kind="stable")
    parts = np.split(order, np.flatnonzero(np.diff(codes[order])) + 1)
    return [(_text(value), part) for value, part in zip(values, parts, strict=True)]


def _text(value: Any) -> str:
    whole = isinstance(value, float) and value.is_integer()
    return " ".join(str(int(value) if whole else value).split())[:MAX_NAME]


def _times(table: Table, found: Columns, unit: str | None, tau: float | None, one: bool) -> Times:
    """Times of the rows; without a column of times the ticks, by an index or the number of the row."""
    if "time" in found.roles:
        return parse_times(table, found.roles["time"], unit)
    if unit is not None:
        raise reject(
            "time_unit", unit, f"no value, as {table.file} has no times: name them by --columns time=..."
        )
    ticks = np.arange(len(table.frame), dtype=np.float64)
    if found.index is not None and one:
        numbers = parse_numbers(table.frame[found.index]).values
        whole = not np.isnan(numbers).any() and (numbers % 1 == 0).all()
        if not whole and not found.chosen:
            raise ArgumentError(
                f"{table.file}: {table.label(found.index)} is no number of the row: name the columns by "
                f"--columns, for example time={found.index + 1} x=... y=..."
            )
        if whole:
            ticks = numbers - numbers[0]
    return Times(tick_times(ticks, 1.0 if tau is None else tau), None, "", "ticks" if tau is None else "s")


def _check_order(
    table: Table, found: Columns, seconds: NDArray[np.float64], rows: NDArray[np.int64], name: str | None
) -> None:
    wrong = np.flatnonzero(~(np.diff(seconds[rows]) > 0.0))
    if not wrong.size:
        return
    before, row = (int(rows[wrong[0] + k]) for k in (0, 1))
    column = found.roles.get("time", found.index)
    assert column is not None  # numbers of rows increase
    cells = table.frame[column]
    advice = f"of object {name}" if name is not None else "(several objects? name their column by --object)"
    raise reject(
        f"{table.place(row)}: {table.label(column)}", str(cells.iloc[row]),
        f"a time after {cells.iloc[before]} {advice}",
    )  # fmt: skip


def _check_one_object(table: Table, seconds: NDArray[np.float64], positions: NDArray[np.float64]) -> None:
    reason = unmarked_objects(seconds, positions)
    if reason is not None:
        raise ArgumentError(
            f"{table.file}: more than one object? ({reason}): name the column of the objects by --object, or "
            "--object none for a single one"
        )


def _breaks(table: Table, rows: NDArray[np.int64]) -> NDArray[np.int64]:
    """Rows at which a segment of a GPX track begins: reception was lost or the logger switched off."""
    if table.segments is None:
        return np.empty(0, np.int64)
    return np.flatnonzero(np.diff(table.segments[rows])) + 1


def _check_tau(tau: float, recording: Recording) -> None:
    if abs(tau - recording.tick) > TAU_TOLERANCE * recording.tick:
        raise reject("tau", tau, f"no value, or the median step of the times, {recording.tick:.6g}")
