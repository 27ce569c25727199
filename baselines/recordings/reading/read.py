"""Reading a file of recorded positions: CSV, TSV, Parquet, GPX or IGC, also compressed by gzip."""

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from baselines.recordings.projection import centred_projection
from baselines.recordings.reading.cells import Table, Times, counted, parse_numbers, parse_times
from baselines.recordings.reading.columns import Columns, find_columns
from baselines.recordings.reading.files import read_table
from baselines.recordings.reading.positions import check_positions, read_polar, read_positions
from baselines.recordings.recording import UNKNOWN_UNIT, Recording, make_recording
from hybrid_env.checks import ArgumentError, FloatArray, IntArray, Positive, checked, reject
from hybrid_env.sensors import Radar


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
    radar: Radar | None = None,
) -> RecordingFile:
    """Read the recordings of a file.

    Args:
        path: the file.
        columns: name or number (from 1) of the column of each of `time`, `x`, `y`, `lat`, `lon`;
            None finds them by their names.
        object_column: column that tells several objects apart; `none` for a file with one object;
            None finds it by its name.
        unit: unit of x and y; `deg` for longitude and latitude; None takes it from the header.
        time_unit: unit of the times: s, ms, us, ns, min, h, or a format such as `%d/%m/%Y
            %H:%M:%S`; None recognises ISO dates and seconds, milliseconds ... since 1970, and
            otherwise means seconds.
        tau: duration of a tick [s] of a file without times; None counts time in ticks.
        gap: longest time between two measurements of one piece [s]; None is 20 nominal ticks.
        radar: that measured columns `range`, `bearing` and, if it has a rate deviation,
            `range_rate`, see `positions.read_polar`.

    Raises:
        ArgumentError: the file cannot be read, or it is not clear what its columns mean; the
            message names file, line, value and what is allowed, or the option that helps.
    """
    for name, value in (
        ("tau", tau),
        ("gap", gap),
    ):
        if value is not None:
            checked(name, value, Positive)
    table = read_table(path)
    found = find_columns(table, columns, object_column, radar is not None)
    groups = object_rows(table, found.object, Path(path))
    times = _times(table, found, time_unit, tau, len(groups) == 1)
    places = (
        read_positions(table, found, unit) if radar is None else read_polar(table, found, radar)
    )
    known = np.asarray(~np.isnan(places.values).any(axis=1))
    recordings = []
    for name, rows in groups:
        measured = rows[known[rows]]
        if len(measured) < 2:
            if len(groups) > 1:
                continue
            raise ArgumentError(
                f"{table.file}: {counted(len(measured), 'measured position')}: expected at"
                " least two"
            )
        check_order(table, found, times.seconds, rows, name)
        marked = object_column is not None or len(groups) > 1
        check_positions(table, places, times.seconds[measured], measured, marked)
        positions = places.values[rows]
        projection = None
        if places.degrees:
            degrees = positions[:, ::-1].T
            projection = centred_projection(*degrees)
            positions = projection.forward(*degrees)
        # A segment of a GPX track: reception was lost or the logger switched off.
        breaks: Any = (
            () if table.segments is None else np.flatnonzero(np.diff(table.segments[rows])) + 1
        )
        recording = make_recording(
            times.seconds[rows],
            positions,
            name=name,
            gap=gap,
            breaks=breaks,
            unit=places.unit or UNKNOWN_UNIT,
            time_unit=times.unit,
            epoch=times.epoch,
            projection=projection,
            radar=radar,
            rates=None if places.rates is None else places.rates[rows],
        )
        recordings.append(recording)
    if not recordings:
        raise ArgumentError(f"{table.file}: no object has two measured positions")
    if len(recordings) < len(groups):
        few = counted(len(groups) - len(recordings), "object")
        table.notes.append(f"{few} with fewer than two measurements left out")
    tick = recordings[0].tick
    # Largest relative difference between a given tick and the one of the times.
    if tau is not None and "time" in found.roles and abs(tau - tick) > 1e-3 * tick:
        raise reject("tau", tau, f"no value, or the median step of the times, {tick:.6g}")
    return RecordingFile(tuple(recordings), _summary(table, found, times, recordings))


def object_rows(table: Table, column: int | None, path: Path) -> list[tuple[str, IntArray]]:
    """Names of the objects and their rows."""
    if column is None:
        stem = path.name.removesuffix(".gz")
        return [(Path(stem).stem or stem, np.arange(len(table.frame)))]
    cells = table.frame[column]
    empty = np.flatnonzero(cells.isna())
    if empty.size:
        place = table.place(int(empty[0]), column)
        raise ArgumentError(
            f"{place}: the cell is empty: expected an object in every row, or --object none"
        )
    codes, values = pd.factorize(cells)
    order = np.argsort(codes, kind="stable")
    groups = np.split(order, np.flatnonzero(np.diff(codes[order])) + 1)
    return [(cell_text(value), group) for value, group in zip(values, groups, strict=True)]


def cell_text(value: Any) -> str:
    """Return a cell as short text; whole numbers have no decimal point."""
    whole = isinstance(value, float) and value.is_integer()
    # Characters of an object's name.
    return " ".join(str(int(value) if whole else value).split())[:60]


def _times(table: Table, found: Columns, unit: str | None, tau: float | None, one: bool) -> Times:
    """Times of the rows; without a column of times the ticks, by an index or the number of the
    row.
    """
    if "time" in found.roles:
        return parse_times(table, found.roles["time"], unit)
    if unit is not None:
        raise reject(
            "time_unit",
            unit,
            f"no value, as {table.file} has no times: name them by --columns time=...",
        )
    ticks = np.arange(len(table.frame), dtype=np.float64)
    if found.index is not None and one:
        numbers = parse_numbers(table.frame[found.index]).values
        if np.isfinite(numbers).all() and (numbers % 1 == 0).all():
            ticks = numbers - numbers[0]
        elif not found.chosen:
            advice = (
                f"name the columns by --columns, for example time={found.index + 1} x=... y=..."
            )
            raise ArgumentError(
                f"{table.file}: {table.label(found.index)} is no number of the row: {advice}"
            )
    if tau is None:
        return Times(ticks, None, "", "ticks")
    # Without the rounding errors of the products.
    return Times(np.round(tau * ticks, 9 - math.floor(math.log10(tau))), None, "", "s")


def check_order(
    table: Table,
    found: Columns,
    seconds: FloatArray,
    rows: IntArray,
    name: str,
) -> None:
    """Check that the times of an object increase."""
    wrong = np.flatnonzero(~(np.diff(seconds[rows]) > 0.0))
    if not wrong.size:
        return
    before = rows[wrong[0]]
    row = rows[wrong[0] + 1]
    column = found.roles.get("time", found.index)
    # Numbers of rows increase.
    assert column is not None
    cells = table.frame[column]
    several = "(several objects? name their column by --object)"
    advice = several if found.object is None else f"of object {name}"
    raise reject(
        table.place(int(row), column),
        str(cells.iloc[row]),
        f"a time after {cells.iloc[before]} {advice}",
    )


def _summary(table: Table, found: Columns, times: Times, recordings: Sequence[Recording]) -> str:
    """Return file, rows, objects, tick, unit and extent, and what was left out or assumed."""
    # So many columns that are not used are listed in the summary.
    listed = 6
    one, unit = recordings[0], recordings[0].unit
    objects = counted(len(recordings), "object")
    if found.object is not None and len(recordings) > 1:
        objects += f" by '{table.label(found.object)}'"
    tick = np.median([one.tick for one in recordings])
    steps = np.concatenate([np.diff(one.times) for one in recordings])
    ticks = f"tick {tick:.6g} s" if one.time_unit == "s" else "no times: a row is a tick (--tau)"
    # Steps that differ by more than this share of the tick are listed.
    if np.abs(steps - tick).max() > 1e-3 * tick:
        ticks += f" (steps {steps.min():.4g} to {steps.max():.4g})"
    positions = np.concatenate([one.positions for one in recordings])
    low = np.nanmin(positions, axis=0)
    high = np.nanmax(positions, axis=0)
    extent = f"x {low[0]:.6g} to {high[0]:.6g}, y {low[1]:.6g} to {high[1]:.6g} {unit}"
    sentences = [f"{table.file}: {counted(len(table.frame), 'row')}", objects, ticks, extent]
    if one.projection is not None:
        centre = f" around {one.projection.latitude:.6g}, {one.projection.longitude:.6g}"
        sentences.append("degrees projected to metres" + (centre if len(recordings) == 1 else ""))
    if times.kind:
        sentences.append(
            f"times are {times.kind}" + (f" from {times.epoch}" if times.epoch else "")
        )
    missing = int(np.isnan(positions[:, 0]).sum())
    if missing:
        sentences.append(f"{counted(missing, 'row')} without a position")
    pieces = sum(len(one.pieces) for one in recordings)
    if pieces > len(recordings):
        sentences.append(f"{counted(pieces, 'piece')} between gaps")
    if not table.headed and not found.chosen:
        sentences.append(f"no header: columns taken as {', '.join(found.roles)}")
    sentences += table.notes
    if found.index is not None:
        sentences.append(
            "index column " + ("not used" if "time" in found.roles else "taken as ticks")
        )
    if found.left_out:
        more = len(found.left_out) - listed
        names = ", ".join(found.left_out[:listed]) + (f" and {more} more" if more > 0 else "")
        sentences.append(f"columns not used: {names}")
    return "; ".join(sentences)
