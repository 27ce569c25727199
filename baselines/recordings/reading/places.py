"""From cells to positions on a plane or in degrees."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from baselines.recordings.reading import cleaning
from baselines.recordings.reading.columns import MOTIONS
from baselines.recordings.reading.frames import frame_of, of_zones, turned
from baselines.recordings.reading.names import DEGREES, VOID, role_of, split_unit
from baselines.recordings.reading.table import Table
from baselines.recordings.reading.values import (
    Times,
    in_degrees,
    parse_angles,
    parse_numbers,
    texts_of,
)
from baselines.recordings.reading.velocities import METRES
from baselines.recordings.scatter import noise_deviations
from hybrid_env.checks import ArgumentError, BoolArray, FloatArray, IntArray, reject
from hybrid_env.sensors import Radar


class Places(NamedTuple):
    """Positions of all rows of a file."""

    # (n, 2) x and y, or longitude and latitude [deg]; NaN where there is none.
    values: FloatArray
    # (n,) rows with cells that are not empty and no numbers.
    wrong: BoolArray
    # (n,) rows of which the sensor says that it had no position.
    void: BoolArray
    # Of the positions on the plane; None if the file does not name it.
    unit: str | None
    # Whether `values` are degrees.
    degrees: bool = False
    # (n,) above each other, in the unit of the positions; NaN where there is none.
    altitudes: FloatArray | float = np.nan
    # That measured them.
    radar: Radar | None = None
    # (n, k) its range rate, or of other positions the columns of a velocity.
    rates: FloatArray = np.empty((0, 0))
    # Whether these are speed and course.
    polar: bool = False


def check_readable(table: Table, column: int, wrong: BoolArray, allowed: str) -> None:
    """Refuse a column of which most cells cannot be read."""
    if wrong.mean() > 0.5:
        cell = table.frame[column].iloc[int(np.argmax(wrong))]
        raise reject(f"{table.file}: {table.label(column)}", str(cell), allowed)


def read_positions(
    table: Table, roles: dict[str, int], unit: str | None, thousands: str | None, frame: str | None
) -> Places:
    """Parse the columns of the positions; a unit or frame of None is that of the header."""
    degrees = "lat" in roles
    names = ("lon", "lat") if degrees else ("x", "y")
    axes = [roles[role] for role in (*names, "z") if role in roles]
    of_x, of_y = (split_unit(table.names[column])[1] for column in axes[:2])
    for name, value, allowed in (("unit", unit, (None, "m", *DEGREES)), ("frame", frame, (None,))):
        if degrees and value not in allowed:
            raise reject(name, value, f"no value, as {table.file} has latitudes and longitudes")
    if unit is None and of_x != of_y:
        raise ArgumentError(
            f"{table.file}: positions in {of_x} and {of_y}: expected one, or --unit"
        )
    unit = unit or of_x
    if not degrees and unit is not None and unit.lower() in DEGREES:
        degrees = True
        table.notes.append("x taken as longitude and y as latitude")
    values = np.empty((len(table.frame), len(axes)))
    wrong = np.zeros(len(values), np.bool_)
    for k, column in enumerate(axes):
        parse = parse_angles if degrees and k < 2 else parse_numbers
        values[:, k], unread, comma = parse(table.frame[column], thousands)
        if k < 2:
            form = "numbers, or --thousands with the mark between them"
            check_readable(table, column, unread, form)
            wrong |= unread
        table.notes += ["decimal comma"] * comma
    if degrees:
        values[:, :2] = _degrees(table, roles, values[:, :2], of_x)
    else:
        values, degrees = _on_the_plane(table, roles, values, unit, frame)
    unit = "m" if degrees else unit
    altitudes = _altitudes(table, roles, values, unit)
    values = values[:, :2]
    wrong |= (np.abs(values) > ([360.0, 90.0] if degrees else 1e12)).any(axis=1)
    values[wrong] = np.nan
    wrong |= cleaning.fill_values(values)
    values[wrong] = np.nan
    motion = next((pair for pair in MOTIONS if roles.keys() >= {*pair}), ())
    columns = [parse_numbers(table.frame[roles[role]], thousands)[0] for role in motion]
    rates = np.reshape(columns, (len(columns), len(values))).T
    void, polar = _void_rows(table), motion[:1] == ("speed",)
    return Places(values, wrong, void, unit, degrees, altitudes, rates=rates, polar=polar)


def _degrees(
    table: Table, roles: dict[str, int], values: FloatArray, unit: str | None
) -> FloatArray:
    """Return degrees of longitude and latitude (n, 2) of what the columns have."""
    axes = [roles[role] for role in (("lon", "lat") if "lat" in roles else ("x", "y"))]
    semicircles = any("position" in table.names[k].lower() for k in axes)
    values, form = in_degrees(values, semicircles or unit == "semicircles")
    if unit == "rad":
        values, form = np.degrees(values), "radians"
    if form:
        table.notes.append(f"latitude and longitude are {form}")
    check_readable(table, axes[1], np.abs(values[:, 1]) > 90.0, "latitudes up to 90 degrees")
    for k, role in enumerate(("east_west", "north_south")):
        if role in roles:
            letters = texts_of(table.frame[roles[role]]).str.upper()
            values[letters.str.startswith(("W", "S")).to_numpy(), k] *= -1.0
    return values


def _on_the_plane(
    table: Table, roles: dict[str, int], values: FloatArray, unit: str | None, frame: str | None
) -> tuple[FloatArray, bool]:
    """Return positions (n, 2), or with altitudes (n, 3), with x east and y north, and whether they
    are degrees now.
    """
    scale = 1e3 if unit == "km" else 1.0
    found = frame_of(table, roles, values * scale, frame, str(unit).startswith(("px", "pixel")))
    if "zone" in roles:
        degrees = of_zones(table, texts_of(table.frame[roles["zone"]]), values[:, :2] * scale)
        if degrees is not None:
            table.notes.append("UTM positions of several zones")
            return np.hstack([degrees, values[:, 2:]]), True
    values, said = turned(values * scale if found == "ecef" else values, found)
    table.notes += [said] * bool(said)
    if found == "ecef":
        # Metres now.
        table.names[roles["z"]] = "z_m"
    return values, found == "ecef"


def _altitudes(
    table: Table, roles: dict[str, int], values: FloatArray, unit: str | None
) -> FloatArray | float:
    """Return altitudes (n,) in the unit of the positions, from the third column of these, NaN
    without one.
    """
    if "z" not in roles or not np.isfinite(values[:, 2]).any():
        roles.pop("z", None)
        return np.nan
    name, own = split_unit(table.names[roles["z"]])
    own = "flight level" if name in ("fl", "flight_level") else own
    heights = {**METRES, "flight level": 30.48}
    if own is None and unit == "m" and np.nanstd(values[:, 2]) > 0.0:
        table.notes.append(f"{table.label(roles['z'])!r} taken as altitude in m (name it ..._ft)")
    # What is not known is the unit of the positions.
    own = own if own in heights else unit or "m"
    return values[:, 2] * heights.get(own, 1.0) / heights.get(unit or "m", 1.0)


def _void_rows(table: Table) -> BoolArray:
    """Return in which rows (n,) the sensor says that it had no position. What most rows say means
    something else.
    """
    void = np.zeros(len(table.frame), np.bool_)
    # Of a sensor that had no position.
    without_fix = "false", "v", "no", "invalid", "void", "none", "no fix", "nofix", "n"
    for column, name in enumerate(table.names):
        role = role_of(name)
        if role not in VOID:
            continue
        cells = texts_of(table.frame[column]).str.lower()
        # The status 0 of a ship is that it moves.
        numbers = [] if "status" in name.lower() else ["0", "0.0"]
        # Of an autopilot, 2 and 3 are the dimensions of a fix.
        numbers += ["1"] * ("type" in name.lower())
        without = cells.isin([*without_fix, *numbers]).to_numpy()
        if role == "dilution":
            without = (pd.to_numeric(cells, errors="coerce") >= 50.0).to_numpy()
        void |= without & (without.mean() < 0.5)
    return void


def read_polar(
    table: Table,
    roles: dict[str, int],
    times: Times,
    rows_of: Sequence[tuple[str, IntArray]],
    radar: Radar | None,
    thousands: str | None,
) -> Places:
    """Parse ranges and bearings of a radar to positions, and range rates if it measures them.
    Without a radar its standard deviations are those of the measurements.
    """
    names = ("range", "bearing", "rate")[: 2 if radar is None else radar.values]
    columns = [parse_numbers(table.frame[roles[name]], thousands) for name in names]
    length, angle, *speed = (split_unit(table.names[roles[name]])[1] for name in names)
    if angle not in (None, "rad", *DEGREES):
        name = f"{table.file}: unit of {table.label(roles['bearing'])}"
        raise reject(name, angle, "deg or rad")
    if length is not None and speed not in ([], [None], [f"{length}/s"]):
        name = f"{table.file}: unit of {table.label(roles['rate'])}"
        raise reject(name, speed[0], f"{length}/s, as of the range")
    radians = angle == "rad"
    table.notes.append(
        f"bearings in {'radians from the x axis' if radians else 'degrees from north'}"
    )
    ranges, bearings, *rates = (numbers for numbers, _, _ in columns)
    wrong = np.any([wrong for _, wrong, _ in columns], axis=0)
    with np.errstate(invalid="ignore"):
        wrong |= (ranges < 0.0) | (ranges > 1e12) | (np.abs(bearings) > 1e12)
    rows = np.column_stack([ranges, bearings if radians else np.radians(90.0 - bearings)])
    rows[wrong] = np.nan
    if radar is None:
        radar = _found_radar(table, times.seconds, rows, rows_of, length or "units")
    positions = np.array([radar.located(row)[:2] for row in rows])
    speeds = np.reshape(rates, (len(rates), len(rows))).T
    return Places(positions, wrong, _void_rows(table), length, radar=radar, rates=speeds)


def _found_radar(
    table: Table,
    seconds: FloatArray,
    polar: FloatArray,
    rows_of: Sequence[tuple[str, IntArray]],
    unit: str,
) -> Radar:
    """Return a radar at the origin with the standard deviations of measured ranges and bearings,
    (n, 2).
    """
    tracks = []
    known = np.isfinite(seconds) & np.isfinite(polar).all(axis=1)
    for _, rows in rows_of:
        instants, first = np.unique(seconds[rows[known[rows]]], return_index=True)
        values = polar[rows[known[rows]][first]]
        values[:, 1] = np.unwrap(values[:, 1])
        tracks.append((instants, values))
    deviations = noise_deviations(tracks)
    if deviations is None or not deviations.all():
        raise ArgumentError(
            f"{table.file}: range and azimuth of a radar, whose standard deviations are not seen"
            " (few or rounded measurements): give them by --radar, for example --radar '30 0.01'"
        )
    length, angle = deviations.tolist()
    table.notes.append(
        f"range and azimuth of a radar: standard deviations {length:.3g} {unit} and"
        f" {np.degrees(angle):.3g} deg are found; give them by --radar '{length:.3g} {angle:.3g}'"
    )
    return Radar(range_deviation=length, bearing_deviation=angle)
