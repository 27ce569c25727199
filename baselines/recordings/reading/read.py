"""Reading a file of recorded positions, also compressed by gzip."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
import pandas as pd

from baselines.recordings.projection import centred_projection
from baselines.recordings.reading import cleaning
from baselines.recordings.reading.columns import find_columns
from baselines.recordings.reading.files import check_sizes, named_in_errors, read_table
from baselines.recordings.reading.names import ONE_OBJECT, role_of
from baselines.recordings.reading.places import (
    Places,
    check_readable,
    read_polar,
    read_positions,
    void_rows,
)
from baselines.recordings.reading.summary import summary
from baselines.recordings.reading.table import Table
from baselines.recordings.reading.values import Times, names_of, parse_times, writable
from baselines.recordings.reading.velocities import find_velocities
from baselines.recordings.recording import Recording, dates_since, iso_texts, make_recording
from hybrid_env.checks import ArgumentError, reject
from hybrid_env.sensors import Radar


@dataclass(frozen=True, eq=False)
class RecordingFile:
    """What was read of a file.

    Attributes:
        recordings: one for each object, in the order in which they appear in the file.
        summary: one line that says what was read and what was left out.
        left_out: number of lines that were left out, by the reason.
        warnings: one line for each; more than a tenth of the rows were left out, or an object.
        objects: number of objects in the file, also of those that were left out.
    """

    recordings: tuple[Recording, ...]
    summary: str
    left_out: dict[str, int]
    warnings: tuple[str, ...] = ()
    objects: int = 1


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
    thousands: str | None = None,
    frame: str | None = None,
    bad_rows: Literal["skip", "refuse"] = "skip",
) -> RecordingFile:
    """Read the recordings of a file.

    Rows that are no measurements of their own are left out and counted: those without a time or
    with cells that cannot be read, repeated times, positions that a stale source repeats,
    comments, blank lines and repeated headers. Rows out of order are sorted. A row with
    an empty position is a missing measurement. Objects may also have two columns each, for x with
    their name and for y without one.

    Args:
        path: the file.
        columns: name or number (from 1) of the column of each of `time`, `date`, `x`, `y`, `lat`,
            `lon`, or `position` for both in one cell, and of a measured velocity `vx` and `vy` or
            `speed` and `course`; None finds them by their names. A velocity is used if it agrees
            with the positions, which also say its unit.
        object_column: column that tells several objects apart; `none` for a file with one object;
            None finds it by its name.
        unit: unit of x and y; `deg` for longitude and latitude; None takes it from the header.
        time_unit: unit of the times: s, ms, us, ns, min, h, d, or a format such as `%d/%m/%Y
            %H:%M:%S`; None recognises dates, times of day, and seconds, milliseconds ... since
            1970, and otherwise means seconds.
        tau: duration of a tick [s] of a file without times; None counts time in ticks.
        gap: longest time between two measurements of one piece [s]; None is 20 nominal ticks.
        radar: that measured columns `range`, `bearing` and, if it has a rate deviation,
            `range_rate`; None finds the standard deviations of a radar at the origin in a file
            without other positions. Bearings in degrees are clockwise from the y axis (north),
            those in radians counter-clockwise from the x axis.
        thousands: mark between thousands in numbers.
        frame: where x and y point: `enu` east and north, `ned` north and east, `image` right and
            down, `ecef` with z from the centre of the earth; None finds it by names, otherwise
            `enu` is assumed, which the summary says.
        bad_rows: `refuse` raises for the first row that would be left out.

    Raises:
        ArgumentError: the file cannot be read, it is not clear what its columns mean, or more than
            half of its rows would be left out; the message names file, line or cause, and the
            option that helps.
    """
    with named_in_errors(path) as file:
        table = read_table(path)
        table.thousands, table.file = thousands, file
        if table.frame.empty:
            raise ArgumentError("expected rows of numbers")
        single = object_column == ONE_OBJECT
        if not columns and (pairs := _pairs(table)):
            table, single = _below_each_other(table, pairs), True
            object_column = str(len(table.names))
        polar = ("range", "bearing", "rate")
        axes = (
            (("x", "y"), ("lat", "lon"), polar[:2]) if radar is None else (polar[: radar.values],)
        )
        find_columns(table, columns, object_column, axes)
        objects = object_names(table, Path(path))
        times = read_times(table, time_unit, tau)
        if "range" in table.roles:
            places = read_polar(table, times.seconds, objects, radar)
        else:
            places = read_positions(table, unit, frame)
        rows = places.rows.assign(
            time=times.seconds,
            cell=times.cells,
            void=void_rows(table),
            segment=table.segments,
            object=objects,
        )
        if object_column is None and cleaning.told_apart(table, rows):
            rows["object"] = object_names(table, Path(path))
        by_object = rows.groupby("object", sort=False)
        recordings, refused = [], []
        for _, own in by_object:
            try:
                recordings.append(_recording(table, times, places, own, gap, single))
            except ArgumentError as error:
                refused.append(str(error))
        if bad_rows == "refuse" and table.left_out:
            line, reason = min((min(lines), reason) for reason, lines in table.left_out.items())
            raise ArgumentError(f"line {line}: {reason}: left out with --bad-rows skip")
        if not recordings:
            raise ArgumentError([*refused, "no row names an object"][0])
        tick = recordings[0].tick
        if tau is not None and "time" in table.roles and abs(tau / tick - 1) > 1e-3:
            raise reject("tau", tau, f"no value, or the median step of the times, {tick:.6g}")
        count, total = cleaning.lost(table), len(table.frame)
        if count > 0.1 * total:
            causes = cleaning.causes(table)
            refused.insert(0, f"{table.file}: {count:,} of {total:,} rows are left out: {causes}")
        left_out = {reason: len(lines) for reason, lines in table.left_out.items()}
        return RecordingFile(
            tuple(replace(recording, left_out=left_out) for recording in recordings),
            summary(table, times, recordings),
            left_out,
            tuple(refused),
            len(by_object),
        )


def _pairs(table: Table) -> list[int]:
    """Return the first columns of objects that have one for x, with their name, and one for y,
    without a name; none if there are not two, or another column is a position.
    """
    names = [*table.names, "end"]
    roles = [role_of(name) for name in names]
    if {*roles} & {"x", "y", "lat", "lon", "position", "range", "bearing"}:
        return []
    pairs = [
        k
        for k in range(len(names) - 2)
        if names[k] and not names[k + 1] and names[k + 2] and roles[k] is None
    ]
    return pairs if len(pairs) > 1 else []


def _below_each_other(table: Table, pairs: list[int]) -> Table:
    """Return a table whose last columns are x, y and object, of one whose objects have two columns
    each, see `_pairs`.
    """
    others = [k for k in range(len(table.names)) if not {k, k - 1} & {*pairs}]
    check_sizes(cells=len(pairs) * len(table.frame) * (len(others) + 3))
    parts = [
        table.frame[[*others, k, k + 1]].set_axis(range(len(others) + 2), axis=1) for k in pairs
    ]
    frame = pd.concat(parts)
    frame["object"] = np.repeat([table.names[k] for k in pairs], len(table.frame))
    frame.columns = [*(table.names[k] for k in others), "x", "y", "object"]
    table.notes.append("objects have columns for x and y each")
    return replace(table, frame=frame)


def object_names(table: Table, path: Path) -> "pd.Series[str]":
    """Return the name of the object of each row, none where its cell is empty."""
    if "object" not in table.roles:
        stem = path.name.removesuffix(".gz")
        return pd.Series(writable(Path(stem).stem or stem), table.frame.index)
    names = names_of(table.cells("object"))
    table.leave_out("rows without an object", names.index[names.isna()])
    return names


def read_times(table: Table, unit: str | None = None, tau: float | None = None) -> Times:
    """Return the times of all rows; without a column of times the ticks, by an index or by the
    number of the row.
    """
    role = next((role for role in ("fix_time", "time", "date", "index") if role in table.roles), "")
    ticks = np.arange(len(table.frame), dtype=np.float64)
    if role:
        date = table.cells("date") if "date" in table.roles and role != "date" else None
        times = parse_times(table.cells(role), date, unit, table.unit(role))
        allowed = "a number, a date, or --time-unit with a format such as '%d/%m/%Y %H:%M:%S'"
        check_readable(table, role, np.isnan(times.seconds), allowed)
        if times.cells is None and times.epoch is not None:
            known = np.nan_to_num(times.seconds)
            times = times._replace(cells=iso_texts(dates_since(times.epoch, known)))
        if role != "index" or times.kind or (times.seconds % 1.0).any():
            return times
        ticks = times.seconds - times.seconds.min()
        table.notes.append(f"{table.label(role)!r} taken as ticks")
    elif unit is not None:
        allowed = "no value, as the file has no times: name them by --columns time=..."
        raise reject("time_unit", unit, allowed)
    if tau is None:
        return Times(ticks, None, "", "ticks")
    # Without the rounding errors of the products.
    return Times(np.round(tau * ticks, 9 - int(np.floor(np.log10(tau)))), None, "")


def _recording(
    table: Table, times: Times, places: Places, rows: pd.DataFrame, gap: float | None, single: bool
) -> Recording:
    """Return the recording of an object. `single`: the caller says that the rows are of one."""
    name, total, already = rows.object.iloc[0], len(rows), cleaning.lost(table)
    rows = cleaning.sorted_rows(table, rows)
    rows = table.without(rows, rows.void, "rows of a sensor without a fix")
    rows = table.without(rows, rows.wrong, "rows whose position cannot be read")
    axes, unit = ["x", "y"], places.unit or "units"
    count = len(rows.dropna(subset=axes))
    if count < 2:
        raise ArgumentError(f"{name}: {count} measured positions: expected at least two")
    projection = None
    if places.degrees:
        projection = centred_projection(rows.y, rows.x)
        rows[axes] = projection.forward(rows.y, rows.x)
    distance, jumps = cleaning.jumps_between_places(rows.dropna(subset=axes))
    rows = cleaning.rows_of_times(table, rows)
    measured = rows.dropna(subset=axes)
    if places.unit is None and len(measured) > 1 and cleaning.look_like_degrees(measured):
        raise ArgumentError(
            f"x and y of {name} look like degrees: --unit deg for longitude x and"
            " latitude y, or --unit m for a plane"
        )
    rows = cleaning.fresh_rows(table, rows)
    several = "name by --object the column that tells them apart"
    if jumps and not single:
        raise ArgumentError(
            f"{name} jumps {jumps:,} times between two places that are"
            f" {float(f'{distance:.3g}'):,g} {unit} apart, as two objects of one name: {several}"
        )
    if not single and cleaning.rows_alternate(rows.dropna(subset=axes)):
        raise ArgumentError(
            "rows alternate between places that are far apart, as of two objects:"
            f" {several}, or --object none for a single one"
        )
    if cleaning.lost(table) - already > 0.5 * total and not single:
        causes = cleaning.causes(table)
        raise ArgumentError(f"more than half of {name} is left out: {causes}")
    rates = rows.filter(like="rate").to_numpy()
    if places.radar is None and rates.size:
        rates, note = find_velocities(rows, places.polar, places.unit)
        table.notes.append(note)
    different = rows.altitude.nunique()
    if different == 1:
        table.notes.append("all altitudes are the same and say nothing")
    return make_recording(
        rows.time,
        rows[axes],
        altitudes=rows.altitude.to_numpy() if different > 1 else None,
        name=name,
        gap=gap,
        # Reception was lost, or the logger was switched off.
        breaks=np.flatnonzero(rows.segment.diff().fillna(0.0)),
        unit=unit,
        time_unit=times.unit,
        epoch=times.epoch,
        projection=projection,
        radar=places.radar,
        rates=rates,
        lines=rows.index.to_numpy(),
        time_cells=None if times.cells is None else rows.cell.to_numpy(),
    )
