"""From cells to positions on a plane, and what they must not look like: degrees, and several
objects.
"""

from typing import NamedTuple

import numpy as np

from baselines.recordings.reading.cells import Numbers, Table, parse_numbers
from baselines.recordings.reading.columns import Columns
from baselines.recordings.reading.names import DEGREES, split_unit
from hybrid_env.checks import ArgumentError, FloatArray, IntArray, reject
from hybrid_env.sensors import Radar

# Largest absolute value of a coordinate; its powers do not overflow.
MAX_VALUE = 1e12
# [deg]
MAX_LATITUDE, MAX_LONGITUDE = 90.0, 360.0


class Places(NamedTuple):
    """Positions of all rows of a file."""

    # (n, 2) x and y, or longitude and latitude [deg]; NaN where a cell is empty.
    values: FloatArray
    # Of the positions on the plane; None if the file does not name it.
    unit: str | None
    # Whether `values` are degrees.
    degrees: bool
    # (n,) range rates of a radar.
    rates: FloatArray | None = None


def _read(table: Table, column: int, largest: float, smallest: float | None = None) -> Numbers:
    """Parse a column of numbers of a magnitude, or empty cells. smallest: None is minus the
    largest.
    """
    found = parse_numbers(table.frame[column])
    least = -largest if smallest is None else smallest
    wrong = np.union1d(
        found.wrong,
        np.flatnonzero((found.values > largest) | (found.values < least)),
    )
    if wrong.size:
        cell = table.frame[column].iloc[wrong[0]]
        shown = cell if isinstance(cell, (str, float, int, bool)) else str(cell)
        limits = (
            f"of magnitude at most {largest:g}"
            if smallest is None
            else f"from {smallest:g} to {largest:g}"
        )
        allowed = f"a finite number {limits}, or an empty cell"
        raise reject(table.place(int(wrong[0]), column), shown, allowed)
    return found


def read_positions(table: Table, found: Columns, unit: str | None) -> Places:
    """Parse the columns of the positions; a unit of None is that of the header."""
    degrees = "lat" in found.roles
    axes = [found.roles[role] for role in (("lon", "lat") if degrees else ("x", "y"))]
    named = {split_unit(table.names[column])[1] for column in axes}
    if degrees and unit not in (None, "m", *DEGREES):
        raise reject("unit", unit, f"no value, as {table.file} has latitudes and longitudes")
    if not degrees and unit is None:
        if len(named) > 1:
            raise ArgumentError(
                f"{table.file}: {table.labels(axes)} have different units: expected one, or --unit"
            )
        unit = named.pop()
    if not degrees and unit is not None and unit.lower() in DEGREES:
        degrees = True
        table.notes.append("x taken as longitude and y as latitude")
    limits = (MAX_LONGITUDE, MAX_LATITUDE) if degrees else (MAX_VALUE, MAX_VALUE)
    numbers = [_read(table, column, limit) for column, limit in zip(axes, limits, strict=True)]
    if any(one.comma for one in numbers):
        table.notes.append("decimal comma")
    return Places(
        np.column_stack([one.values for one in numbers]),
        "m" if degrees else unit,
        degrees,
    )


def read_polar(table: Table, found: Columns, radar: Radar) -> Places:
    """Parse ranges and bearings of a radar to positions, and range rates if it measures them.
    Bearings in degrees are clockwise from the y axis (north), those in radians counter-clockwise
    from the x axis.
    """
    names = ("range", "bearing", "rate")[: radar.values]
    if names[-1] not in found.roles:
        raise ArgumentError(f"{table.file}: no column range_rate: name it by --columns rate=...")
    least = {"range": 0.0}
    ranges, bearings, *rates = (
        _read(table, found.roles[name], MAX_VALUE, least.get(name)).values for name in names
    )
    length, angle, *speed = (split_unit(table.names[found.roles[name]])[1] for name in names)
    if angle not in (None, "rad", *DEGREES):
        raise reject(
            f"{table.file}: unit of {table.label(found.roles['bearing'])}",
            angle,
            "deg or rad",
        )
    if length is not None and speed not in ([], [None], [f"{length}/s"]):
        raise reject(
            f"{table.file}: unit of {table.label(found.roles['rate'])}",
            speed[0],
            f"{length}/s, as of the range",
        )
    radians = angle == "rad"
    table.notes.append(
        f"bearings in {'radians from the x axis' if radians else 'degrees from north'}"
    )
    rows = np.column_stack([ranges, bearings if radians else np.radians(90.0 - bearings)])
    positions = np.array([radar.located(row)[:2] for row in rows])
    return Places(positions, length, False, *rates)


def check_positions(
    table: Table,
    places: Places,
    seconds: FloatArray,
    rows: IntArray,
    marked: bool,
) -> None:
    """Check that measurements look like those of one object, and without a unit not like degrees:
    those in `rows` (k,), at least two, at increasing times [s] or numbers of rows; `marked`: they
    are known to be of one object.
    """
    positions = places.values[rows]
    reason = None if marked else _unmarked_objects(seconds, positions)
    if reason is not None:
        advice = "name the column of the objects by --object, or --object none for a single one"
        raise ArgumentError(f"{table.file}: more than one object? ({reason}): {advice}")
    if places.unit is None and _look_like_degrees(seconds, positions):
        (west, south), (east, north) = positions.min(axis=0), positions.max(axis=0)
        raise ArgumentError(
            f"{table.file}: x from {west:.6g} to {east:.6g} and y from {south:.6g} to {north:.6g}"
            " look like degrees: --unit deg for longitude x and latitude y, or --unit m for a"
            " plane"
        )


def _look_like_degrees(seconds: FloatArray, positions: FloatArray) -> bool:
    """Whether x and y may be degrees: in their range, slow, and far from 0 for their extent."""
    largest = np.abs(positions).max(axis=0)
    extent = np.ptp(positions, axis=0)
    if largest.max() > MAX_LONGITUDE / 2.0 or largest.min() > MAX_LATITUDE or not extent.any():
        return False
    speeds = np.abs(np.diff(positions, axis=0)).max(axis=1) / np.diff(seconds)
    offset = np.abs(np.median(positions, axis=0)).max()
    # Objects move by less than 0.01 degrees in a second, and most of them by more metres. Degrees
    # are twice their extent from 0, and at least one degree.
    return bool(np.median(speeds) < 0.01 and offset > max(2.0 * extent.max(), 1.0))


def _unmarked_objects(times: FloatArray, positions: FloatArray) -> str | None:
    """Return why the rows seem to be of more than one object, or None: many are far from the row
    before, but near to one of the three before that, or a single step is far longer than all
    others.
    """
    # A jump this close to an end of the recording is an error of measurement rather than another
    # object.
    end_share = 0.2
    # Rows among which the previous row of the same object is looked for.
    window = 4
    count = len(positions)
    if count < 8:
        return None
    before = np.full((window, count), np.inf)
    for lag, row in enumerate(before, start=1):
        row[lag:] = np.hypot(*(positions[lag:] - positions[:-lag]).T)
    nearest = before.min(axis=0)[window:]
    # A row is far from the previous one if another of the rows before it is this many times nearer.
    far = before[0, window:] > 10.0 * nearest
    if np.median(nearest) > 0.0 and far.mean() >= 0.25:
        return "rows alternate between places that are far apart"
    speeds = before[0, 1:] / np.diff(times)
    at = int(np.argmax(speeds))
    others = np.delete(speeds, at).max()
    # A jump is this many times faster than any other step.
    if speeds[at] > 50.0 * others > 0.0 and end_share <= (at + 1) / count <= 1.0 - end_share:
        return (
            f"a jump of {before[0, at + 1]:.6g}, {speeds[at] / others:.0f} times faster than any"
            " other step"
        )
    return None
