"""Where the axes of positions point, and positions with x east and y north."""

import re

import numpy as np
import pandas as pd
import pyproj

from baselines.recordings.reading.names import plain_name, split_unit
from baselines.recordings.reading.table import Table
from baselines.recordings.reading.values import texts_of
from hybrid_env.checks import ArgumentError, reject

FRAMES = "enu", "ned", "image", "ecef"


def _frame_of(table: Table, rows: pd.DataFrame, given: str | None, unit: str | None) -> str | None:
    """Return the frame of positions on a plane, where x and y point, by the names and sizes of the
    columns: "enu", x east and y north; "ned", x north and y east; "image", y down; "ecef", from the
    earth's centre. None if nothing says it.

    Args:
        table: cells of the file.
        rows: their `x`, `y` and `altitude`.
        given: by the caller, who is right where names do not contradict.
        unit: of the positions.
    """
    if given is not None and given not in FRAMES:
        raise reject("frame", given, f"one of {', '.join(FRAMES)}")
    if given == "ecef" and "z" not in table.roles:
        raise reject("frame", given, f"x, y and z: the file has no z ({table.listed()})")
    title = table.names[table.roles["x"]]
    name = split_unit(title)[0]
    # Of columns that are named by where they point.
    compass = r"(?:.*_)?(?:e|n|\w*(?:east|north|nord)\w*|ost|utm_[xy]|rechtswert|hochwert)"
    if re.fullmatch(compass, name):
        if given not in (None, "enu"):
            raise reject("frame", given, f"enu, as the file has a column {name}")
        return "enu"
    if given is not None:
        return given
    words = {*plain_name(title).split("_")}
    known = {*map(plain_name, table.names)}
    flown = {"vx", "vy", "z"} <= {name.rpartition("_")[2] for name in known}
    # Only a log of PX4 has these beside vx, vy and z.
    autopilot = {"xy_valid", "xy_global", "ref_lat", "delta_heading", "dist_bottom", "z_deriv"}
    if "ned" in words or (flown and (rows.altitude.median() < 0.0 or autopilot & known)):
        return "ned"
    if words & {"pixel", "px", "image", "img"} or str(unit).startswith(("px", "pixel")):
        return "image"
    # Distances of the surface and of aircraft from the centre of the earth [m].
    metres = np.hypot(np.hypot(rows.x, rows.y), rows.altitude) * (1e3 if unit == "km" else 1.0)
    if 6.3e6 < metres.median() < 6.45e6:
        return "ecef"
    return "enu" if "enu" in words else None


def to_east_and_north(
    table: Table, rows: pd.DataFrame, unit: str | None, frame: str | None
) -> bool:
    """Turn `x`, `y` and `altitude` of rows to those with x east and y north, and return whether
    they are longitude and latitude now.
    """
    found = _frame_of(table, rows, frame, unit)
    scale = 1e3 if unit == "km" else 1.0
    if "zone" in table.roles and _of_zones(table, rows, scale):
        table.notes.append("UTM positions of several zones")
        return True
    if found == "ecef":
        place = pyproj.Transformer.from_crs("EPSG:4978", "EPSG:4979", always_xy=True)
        axes = ["x", "y", "altitude"]
        degrees = place.transform(*(scale * rows[axes].to_numpy().T))
        rows[axes] = np.where(np.isfinite(degrees), degrees, np.nan).T
        # Metres now.
        table.names[table.roles["z"]] = "z_m"
        table.notes.append("x, y and z are earth-centred (ECEF)")
    elif found == "ned":
        rows["x"], rows["y"], rows["altitude"] = rows.y, rows.x, -rows.altitude
        table.notes.append("x is north and y is east (NED), written as x east and y north")
    elif found == "image":
        rows["y"] *= -1.0
        table.notes.append("y points down (pixels), written with the other sign")
    elif found is None:
        table.notes.append("x east, y north is assumed: left is counter-clockwise")
    return found == "ecef"


def _of_zones(table: Table, rows: pd.DataFrame, scale: float) -> bool:
    """Turn UTM positions in several zones, such as 32N, to longitudes and latitudes; return False
    for a single one.
    """
    parts = texts_of(table.cells("zone")).str.extract(r"^(\d{1,2})\s*([A-Za-z]?)")
    if parts[0].nunique() < 2:
        return False
    degrees = np.full((len(rows), 2), np.nan)
    for (zone, band), of_zone in parts.groupby([0, 1]).indices.items():
        if not 1 <= int(zone) <= 60:
            raise ArgumentError(f"zone {zone} is not allowed: expected 1 to 60")
        # Bands from N are in the north; S is one of these, and the word south.
        plane = pyproj.Proj(proj="utm", zone=int(zone), south="A" <= band.upper() < "N")
        east, north = scale * rows[["x", "y"]].to_numpy()[of_zone].T
        degrees[of_zone] = np.column_stack(plane(east, north, inverse=True))
    rows[["x", "y"]] = degrees
    return True
