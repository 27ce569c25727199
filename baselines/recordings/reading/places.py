"""From cells to positions on a plane or in degrees."""

from typing import NamedTuple

import numpy as np
import pandas as pd

from baselines.recordings.reading import cleaning
from baselines.recordings.reading.columns import MOTIONS
from baselines.recordings.reading.frames import to_east_and_north
from baselines.recordings.reading.names import DEGREES, VOID, role_of, split_unit
from baselines.recordings.reading.table import Table
from baselines.recordings.reading.values import parse_angles, parse_numbers, texts_of
from baselines.recordings.reading.velocities import METRES
from baselines.recordings.scatter import noise_deviations
from hybrid_env.checks import ArgumentError, BoolArray, FloatArray, reject
from hybrid_env.sensors import Radar


class Places(NamedTuple):
    """Positions of all rows of a file."""

    # Columns `x` and `y`, or longitude and latitude [deg], and `altitude`, NaN where there is none;
    # whether x and y are `wrong`: not empty and no numbers; and `rate0` ...: the range rate of a
    # radar, or of other positions the columns of a velocity.
    rows: pd.DataFrame
    # Of the positions on the plane; None if the file does not name it.
    unit: str | None
    # Whether x and y are degrees.
    degrees: bool = False
    # That measured them.
    radar: Radar | None = None
    # Whether a velocity is speed and course.
    polar: bool = False


def check_readable(table: Table, role: str, wrong: BoolArray, allowed: str) -> None:
    """Refuse a column of which most cells cannot be read."""
    if wrong.mean() > 0.5:
        cell = table.cells(role).iloc[int(np.argmax(wrong))]
        raise reject(f"{table.label(role)}", str(cell), allowed)


def read_positions(table: Table, unit: str | None, frame: str | None) -> Places:
    """Parse the columns of the positions; a unit or frame of None is that of the header."""
    degrees = "lat" in table.roles
    axes = ["lon", "lat"] if degrees else ["x", "y"]
    for name, value, allowed in (("unit", unit, (None, "m", *DEGREES)), ("frame", frame, (None,))):
        if degrees and value not in allowed:
            raise reject(name, value, "no value, as the file has latitudes and longitudes")
    of_x, of_y = map(table.unit, axes)
    if unit is None and of_x != of_y:
        raise ArgumentError(f"positions in {of_x} and {of_y}: expected one, or --unit")
    unit = unit or of_x
    if not degrees and unit is not None and unit.lower() in DEGREES:
        degrees = True
        table.notes.append("x taken as longitude and y as latitude")
    rows = pd.DataFrame({"wrong": False, "altitude": np.nan}, table.frame.index)
    for name, role in zip(("x", "y"), axes, strict=True):
        parse = parse_angles if degrees else parse_numbers
        rows[name], unread = table.numbers(role, parse)
        check_readable(table, role, unread, "numbers, or --thousands with the mark between them")
        rows["wrong"] |= unread
    if "z" in table.roles:
        rows["altitude"] = table.numbers("z")[0]
    if degrees:
        _degrees(table, rows, axes, of_x)
    else:
        degrees = to_east_and_north(table, rows, unit, frame)
    unit = "m" if degrees else unit
    _scale_altitudes(table, rows, unit)
    large = rows[["x", "y"]].abs() > ([360.0, 90.0] if degrees else 1e12)
    rows["wrong"] |= large.any(axis=1)
    rows.loc[rows.wrong, ["x", "y"]] = np.nan
    rows["wrong"] |= cleaning.fill_values(rows)
    motion = next((pair for pair in MOTIONS if table.roles.keys() >= {*pair}), ())
    for k, role in enumerate(motion):
        rows[f"rate{k}"] = table.numbers(role)[0]
    return Places(rows, unit, degrees, polar="speed" in motion)


def _degrees(table: Table, rows: pd.DataFrame, axes: list[str], unit: str | None) -> None:
    """Convert `x` and `y` to degrees of longitude and latitude: from radians, semicircles, of which
    2^31 are 180 degrees, whole numbers of 1e-7 degrees, or degrees and minutes such as 4730.5.
    """
    places = rows[["x", "y"]]
    known = places.dropna().abs()
    usual = known.median().max()
    semicircles = any("position" in table.names[table.roles[role]].lower() for role in axes)
    form = ""
    if unit == "rad":
        places, form = np.degrees(places), "radians"
    elif usual > 1e5 and (semicircles or unit == "semicircles"):
        places, form = places * (180.0 / 2**31), "semicircles"
    elif usual > 1e5:
        places, form = places / 1e7, "whole numbers of 1e-7 degrees"
    elif usual > 360.0 and (known % 100.0 < 60.0).all(axis=None):
        whole = (places.abs() // 100.0) * np.sign(places)
        places, form = whole + (places - 100.0 * whole) / 60.0, "degrees and minutes"
    if form:
        table.notes.append(f"latitude and longitude are {form}")
    check_readable(table, axes[1], places.y.abs() > 90.0, "latitudes up to 90 degrees")
    rows[["x", "y"]] = places
    for name, role in (("x", "east_west"), ("y", "north_south")):
        if role in table.roles:
            letters = texts_of(table.cells(role)).str.upper()
            rows.loc[letters.str.startswith(("W", "S")), name] *= -1.0


def _scale_altitudes(table: Table, rows: pd.DataFrame, unit: str | None) -> None:
    """Convert altitudes to the unit of the positions."""
    if rows.altitude.isna().all():
        table.roles.pop("z", None)
        return
    name, own = split_unit(table.names[table.roles["z"]])
    own = "flight level" if name in ("fl", "flight_level") else own
    heights = {**METRES, "flight level": 30.48}
    if own is None and unit == "m" and rows.altitude.std() > 0.0:
        table.notes.append(f"{table.label('z')!r} taken as altitude in m (name it ..._ft)")
    # What is not known is the unit of the positions.
    own = own if own in heights else unit or "m"
    rows["altitude"] *= heights.get(own, 1.0) / heights.get(unit or "m", 1.0)


def void_rows(table: Table) -> BoolArray:
    """Return in which rows (n,) the sensor says that it had no position. What most rows say means
    something else.
    """
    void = np.zeros(len(table.frame), np.bool_)
    for column, name in enumerate(table.names):
        role = role_of(name)
        if role not in VOID:
            continue
        cells = texts_of(table.frame[column]).str.lower()
        if role == "dilution":
            without = (pd.to_numeric(cells, errors="coerce") >= 50.0).to_numpy()
        else:
            words = ["false", "v", "no", "invalid", "void", "none", "no fix", "nofix", "n"]
            # The status 0 of a ship is that it moves.
            words += ["0", "0.0"] * ("status" not in name.lower())
            # Of an autopilot, 2 and 3 are the dimensions of a fix.
            words += ["1"] * ("type" in name.lower())
            without = cells.isin(words).to_numpy()
        void |= without & (without.mean() < 0.5)
    return void


def read_polar(
    table: Table, seconds: FloatArray, objects: "pd.Series[str]", radar: Radar | None
) -> Places:
    """Parse ranges and bearings of a radar to positions, and range rates if it measures them.
    Without a radar its standard deviations are those of the measurements at the times [s] of the
    rows, (n,), of each object.
    """
    names = ("range", "bearing", "rate")[: 2 if radar is None else radar.values]
    length, angle, *speed = map(table.unit, names)
    if angle not in (None, "rad", *DEGREES):
        name = f"unit of {table.label('bearing')}"
        raise reject(name, angle, "deg or rad")
    if length is not None and speed not in ([], [None], [f"{length}/s"]):
        name = f"unit of {table.label('rate')}"
        raise reject(name, speed[0], f"{length}/s, as of the range")
    radians = angle == "rad"
    table.notes.append(
        f"bearings in {'radians from the x axis' if radians else 'degrees from north'}"
    )
    columns = [table.numbers(name) for name in names]
    ranges, bearings, *rates = (numbers for numbers, _ in columns)
    wrong = np.any([wrong for _, wrong in columns], axis=0)
    with np.errstate(invalid="ignore"):
        wrong |= (ranges < 0.0) | (ranges > 1e12) | (np.abs(bearings) > 1e12)
    polar = np.column_stack([ranges, bearings if radians else np.radians(90.0 - bearings)])
    polar[wrong] = np.nan
    if radar is None:
        radar = _found_radar(table, seconds, polar, objects, length or "units")
    rows = pd.DataFrame({"wrong": wrong, "altitude": np.nan}, table.frame.index)
    rows[["x", "y"]] = [radar.located(row)[:2] for row in polar]
    for rate in rates:
        rows["rate0"] = rate
    return Places(rows, length, radar=radar)


def _found_radar(
    table: Table, seconds: FloatArray, polar: FloatArray, objects: "pd.Series[str]", unit: str
) -> Radar:
    """Return a radar at the origin with the standard deviations of measured ranges and bearings,
    (n, 2).
    """
    names = {"object": objects.to_numpy(), "time": seconds}
    rows = pd.DataFrame(names | {"range": polar[:, 0], "bearing": polar[:, 1]}).dropna()
    tracks = []
    for _, track in rows.groupby("object"):
        track = track.drop_duplicates("time").sort_values("time")
        values = np.column_stack([track["range"], np.unwrap(track.bearing)])
        tracks.append((track.time.to_numpy(), values))
    deviations = noise_deviations(tracks)
    if deviations is None or not deviations.all():
        raise ArgumentError(
            "range and azimuth of a radar, whose standard deviations are not seen"
            " (few or rounded measurements): give them by --radar, for example --radar '30 0.01'"
        )
    length, angle = deviations.tolist()
    table.notes.append(
        f"range and azimuth of a radar: standard deviations {length:.3g} {unit} and"
        f" {np.degrees(angle):.3g} deg are found; give them by --radar '{length:.3g} {angle:.3g}'"
    )
    return Radar(range_deviation=length, bearing_deviation=angle)
