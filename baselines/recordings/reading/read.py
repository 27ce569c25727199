"""Reading a file of recorded positions, also compressed by gzip."""

import functools
import os
import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd

from baselines.recordings.projection import centred_projection
from baselines.recordings.reading import cleaning
from baselines.recordings.reading.columns import find_columns
from baselines.recordings.reading.files import read_table
from baselines.recordings.reading.names import ONE_OBJECT, role_of, split_unit
from baselines.recordings.reading.places import Places, check_readable, read_polar, read_positions
from baselines.recordings.reading.summary import summary
from baselines.recordings.reading.table import Table
from baselines.recordings.reading.values import Times, parse_times
from baselines.recordings.reading.velocities import find_velocities
from baselines.recordings.recording import Recording, dates_since, iso_texts, make_recording
from hybrid_env.checks import ArgumentError, IntArray, reject
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
    table = read_table(path)
    if table.frame.empty:
        raise reject("file", table.file, "rows of numbers")
    if not columns and (pairs := _pairs(table)):
        given = {"unit": unit, "time_unit": time_unit, "tau": tau, "gap": gap}
        given |= {"thousands": thousands, "frame": frame, "bad_rows": bad_rows}
        return _read_pairs(path, table, pairs, given)
    polar = ("range", "bearing", "rate")
    axes = (("x", "y"), ("lat", "lon"), polar[:2]) if radar is None else (polar[: radar.values],)
    roles = find_columns(table, columns, object_column, axes)
    rows_of = object_rows(table, roles, Path(path))
    times = read_times(table, roles, time_unit, tau)
    if "bearing" in roles:
        places = read_polar(table, roles, times, rows_of, radar, thousands)
    else:
        places = read_positions(table, roles, unit, thousands, frame)
    everything = pd.DataFrame(
        {
            "time": times.seconds,
            "x": places.values[:, 0],
            "y": places.values[:, 1],
            "altitude": places.altitudes,
            "wrong": places.wrong,
            "void": places.void,
            "cell": times.cells,
            **{f"rate{k}": column for k, column in enumerate(places.rates.T)},
            "segment": table.segments,
        },
        table.frame.index,
    )
    if object_column is None:
        everything["object"] = table.frame[roles["object"]] if "object" in roles else 0
        if telling := cleaning.telling_columns(table, everything, roles.values()):
            rows_of = _told_apart(table, roles, telling, Path(path))
    single = object_column == ONE_OBJECT
    marked = object_column is not None or len(rows_of) > 1
    recordings, refused = [], []
    for name, rows in rows_of:
        try:
            own = everything.iloc[rows]
            recordings.append(
                _recording(
                    table, times, places, own, name=name, gap=gap, marked=marked, single=single
                )
            )
        except ArgumentError as error:
            refused.append(str(error))
    if bad_rows == "refuse" and table.left_out:
        line, reason = min((min(lines), reason) for reason, lines in table.left_out.items())
        raise ArgumentError(f"{table.file}, line {line}: {reason}: left out with --bad-rows skip")
    if not recordings:
        raise ArgumentError(refused[0])
    tick = recordings[0].tick
    if tau is not None and "time" in roles and abs(tau / tick - 1) > 1e-3:
        raise reject("tau", tau, f"no value, or the median step of the times, {tick:.6g}")
    count, total = cleaning.lost(table), len(table.frame)
    if count > 0.1 * total:
        causes = cleaning.causes(table)
        refused.insert(0, f"{table.file}: {count:,} of {total:,} rows are left out: {causes}")
    left_out = {reason: len(lines) for reason, lines in table.left_out.items()}
    return RecordingFile(
        tuple(replace(recording, left_out=left_out) for recording in recordings),
        summary(table, roles, times, recordings),
        left_out,
        tuple(refused),
        len(rows_of),
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


def _read_pairs(
    path: str | os.PathLike[str], table: Table, pairs: list[int], given: dict[str, Any]
) -> RecordingFile:
    """Return what was read of a file whose objects have two columns each, see `_pairs`; `given` are
    keywords of `read_recordings`.
    """
    files, recordings, refused = [], [], []
    for k in pairs:
        numbers = {"x": str(k + 1), "y": str(k + 2)}
        try:
            of_object = read_recordings(path, columns=numbers, object_column=ONE_OBJECT, **given)
        except ArgumentError as error:
            refused.append(f"{table.names[k]}: {error}")
            continue
        files.append(of_object)
        recordings.append(replace(of_object.recordings[0], name=_writable(table.names[k])))
    if not files:
        raise ArgumentError(refused[0])
    left_out: Counter[str] = Counter()
    for each in files:
        left_out.update(each.left_out)
    return RecordingFile(
        tuple(recordings),
        f"{len(files)} objects with columns for x and y each; the first: {files[0].summary}",
        dict(left_out),
        (*refused, *(line for each in files for line in each.warnings)),
        len(pairs),
    )


def _told_apart(
    table: Table, roles: dict[str, int], columns: tuple[int, ...], path: Path
) -> list[tuple[str, IntArray]]:
    """Return the names of the objects and their rows by columns that tell them apart, and by that
    of `roles` if there is one already.
    """
    columns = (*(k for role, k in roles.items() if role == "object"), *columns)
    name = " and ".join(map(table.label, columns))
    table.notes.append(f"{name!r} taken as object, as times repeat without it (--object)")
    roles["object"] = columns[0]
    if len(columns) > 1:
        cells = [table.frame[k].map(cell_text, na_action="ignore") for k in columns]
        roles["object"] = table.add(name, functools.reduce(lambda a, b: a + " " + b, cells))
    return object_rows(table, roles, path)


def object_rows(table: Table, roles: dict[str, int], path: Path) -> list[tuple[str, IntArray]]:
    """Return the names of the objects and their rows."""
    if "object" not in roles:
        stem = path.name.removesuffix(".gz")
        return [(_writable(Path(stem).stem or stem), np.arange(len(table.frame)))]
    codes, names = pd.factorize(table.frame[roles["object"]])
    table.leave_out("rows without an object", table.lines[codes < 0])
    return [(cell_text(name), np.flatnonzero(codes == k)) for k, name in enumerate(names)]


def cell_text(value: Any) -> str:
    """Return a cell as short text; whole numbers have no decimal point, and what would be a formula
    no quotation mark before it, as `hybridtrack track` writes it.
    """
    text = re.sub(r"^(\d+)\.0+$", r"\1", " ".join(str(value).split()))[:60]
    return re.sub(r"^'(?=[=+\-@|])", "", _writable(text))


def _writable(text: str) -> str:
    """Return a text without characters that XML or UTF-8 does not have."""
    return re.sub(r"[\0-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]", "\ufffd", text)


def read_times(
    table: Table, roles: dict[str, int], unit: str | None = None, tau: float | None = None
) -> Times:
    """Return the times of all rows; without a column of times the ticks, by an index or by the
    number of the row.
    """
    clocks = [roles[role] for role in ("fix_time", "time", "date", "index") if role in roles]
    ticks = np.arange(len(table.frame), dtype=np.float64)
    if "fix_time" in roles:
        table.repeats = cleaning.STALE
    if clocks:
        number, date = clocks[0], roles.get("date")
        times = parse_times(
            table.frame[number],
            None if date is None or date == number else table.frame[date],
            unit,
            split_unit(table.names[number])[1],
        )
        allowed = "a number, a date, or --time-unit with a format such as '%d/%m/%Y %H:%M:%S'"
        check_readable(table, number, np.isnan(times.seconds), allowed)
        if times.cells is None and times.epoch is not None:
            known = np.nan_to_num(times.seconds)
            times = times._replace(cells=iso_texts(dates_since(times.epoch, known)))
        if number != roles.get("index") or times.kind or (times.seconds % 1.0).any():
            return times
        ticks = times.seconds - times.seconds.min()
        table.notes.append(f"{table.label(number)!r} taken as ticks")
    elif unit is not None:
        allowed = f"no value, as {table.file} has no times: name them by --columns time=..."
        raise reject("time_unit", unit, allowed)
    if tau is None:
        return Times(ticks, None, "", "ticks")
    # Without the rounding errors of the products.
    return Times(np.round(tau * ticks, 9 - int(np.floor(np.log10(tau)))), None, "")


def _recording(
    table: Table,
    times: Times,
    places: Places,
    rows: pd.DataFrame,
    *,
    name: str,
    gap: float | None,
    marked: bool,
    single: bool,
) -> Recording:
    """Return the recording of an object. `marked`: a column says that the rows are of one object;
    `single`: the caller says so.
    """
    already, total = cleaning.lost(table), len(rows)
    axes, unit = ["x", "y"], places.unit or "units"
    rows = cleaning.sorted_rows(table, rows)
    rows = table.without(rows, rows.void, "rows of a sensor without a fix")
    rows = table.without(rows, rows.wrong, "rows whose position cannot be read")
    measured = rows.dropna(subset=axes)
    if len(measured) < 2:
        raise ArgumentError(
            f"{table.file}: {name} has {len(measured)} measured positions: expected at least two"
        )
    projection = None
    if places.degrees:
        projection = centred_projection(rows.y, rows.x)
        rows[axes] = projection.forward(rows.y, rows.x)
    several = "name by --object the column that tells them apart"
    distance, jumps = cleaning.jumps_between_places(rows.dropna(subset=axes))
    rows = cleaning.rows_of_times(table, rows)
    measured = rows.dropna(subset=axes)
    seen = measured.time.to_numpy(), measured[axes].to_numpy()
    if places.unit is None and len(measured) > 1 and cleaning.look_like_degrees(*seen):
        raise ArgumentError(
            f"{table.file}: x and y of {name} look like degrees: --unit deg for longitude x and"
            " latitude y, or --unit m for a plane"
        )
    stale = measured.index[cleaning.stale_rows(measured[axes].to_numpy())]
    rows = table.without(rows, rows.index.isin(stale), cleaning.STALE)
    if not marked and cleaning.rows_alternate(rows[axes].dropna().to_numpy()):
        raise ArgumentError(
            f"{table.file}: rows alternate between places that are far apart, as of two objects:"
            f" {several}, or --object none for a single one"
        )
    if jumps and not single:
        raise ArgumentError(
            f"{table.file}: {name} jumps {jumps:,} times between two places that are"
            f" {float(f'{distance:.3g}'):,g} {unit} apart, as two objects of one name: {several}"
        )
    if cleaning.lost(table) - already > 0.5 * total and not single:
        causes = cleaning.causes(table)
        raise ArgumentError(f"{table.file}: more than half of {name} is left out: {causes}")
    times_of_rows, positions = rows.time.to_numpy(), rows[axes].to_numpy()
    rates = rows[[name for name in rows if str(name).startswith("rate")]].to_numpy()
    if places.radar is None and rates.shape[1] == 2:
        rates, note = find_velocities(times_of_rows, positions, rates, places.polar, places.unit)
        table.notes.append(note)
        rates = rates if np.isfinite(rates).any() else rates[:, :0]
    altitudes = rows.altitude.to_numpy()
    different = len(np.unique(altitudes[np.isfinite(altitudes)]))
    if different == 1:
        table.notes.append("all altitudes are the same and say nothing")
    return make_recording(
        times_of_rows,
        positions,
        altitudes=altitudes if different > 1 else None,
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
