"""Where the axes of positions point, and positions with x east and y north."""

import re

import numpy as np
import pandas as pd
import pyproj

from baselines.recordings.reading.names import plain_name, split_unit
from baselines.recordings.reading.table import Table
from hybrid_env.checks import ArgumentError, FloatArray, reject


def frame_of(
    table: Table, roles: dict[str, int], values: FloatArray, given: str | None, pixels: bool
) -> str | None:
    """Return the frame of positions on a plane, where x and y point, by the names and sizes of the
    columns: "enu", x east and y north; "ned", x north and y east; "image", y down; "ecef", from the
    earth's centre. None if nothing says it.

    Args:
        table: cells of the file.
        roles: columns of x and y, and of z where there is one.
        values: (n, 2) or with z (n, 3) positions [m].
        given: by the caller, who is right where names do not contradict.
        pixels: whether positions are in pixels.
    """
    frames = "enu", "ned", "image", "ecef"
    if given is not None and given not in frames:
        raise reject("frame", given, f"one of {', '.join(frames)}")
    if given == "ecef" and "z" not in roles:
        raise reject("frame", given, f"x, y and z: {table.file} has no z ({table.listed()})")
    name = split_unit(table.names[roles["x"]])[0]
    # Of columns that are named by where they point.
    compass = r"(?:.*_)?(?:e|n|\w*(?:east|north|nord)\w*|ost|utm_[xy]|rechtswert|hochwert)"
    if re.fullmatch(compass, name):
        if given not in (None, "enu"):
            raise reject("frame", given, f"enu, as {table.file} has a column {name}")
        return "enu"
    if given is not None:
        return given
    words = {*plain_name(table.names[roles["x"]]).split("_")}
    known = {*map(plain_name, table.names)}
    # With z, where all three are numbers.
    places = values[np.isfinite(values).all(axis=1)] if "z" in roles else values[:0]
    height, distance = 0.0, 0.0
    if len(places):
        height, distance = np.median(places[:, 2]), np.median(np.linalg.norm(places, axis=1))
    flown = {"vx", "vy", "z"} <= {name.rpartition("_")[2] for name in known}
    # Only a log of PX4 has these beside vx, vy and z.
    autopilot = {"xy_valid", "xy_global", "ref_lat", "delta_heading", "dist_bottom", "z_deriv"}
    if "ned" in words or (flown and (height < 0.0 or autopilot & known)):
        return "ned"
    if pixels or words & {"pixel", "px", "image", "img"}:
        return "image"
    # Distances of the surface and of aircraft from the centre of the earth [m].
    if 6.3e6 < distance < 6.45e6:
        return "ecef"
    return "enu" if "enu" in words else None


def turned(values: FloatArray, frame: str | None) -> tuple[FloatArray, str]:
    """Return positions (n, 2) with x east and y north, or with altitudes (n, 3), those of the frame
    `ecef` as longitude and latitude [deg], and what is said of it.
    """
    if frame == "ecef":
        place = pyproj.Transformer.from_crs("EPSG:4978", "EPSG:4979", always_xy=True)
        degrees = np.column_stack(place.transform(*values.T))
        degrees[~np.isfinite(degrees)] = np.nan
        return degrees, "x, y and z are earth-centred (ECEF)"
    if frame == "ned":
        axes = [1, 0, 2][: values.shape[1]]
        down = [1.0, 1.0, -1.0][: values.shape[1]]
        return values[
            :, axes
        ] * down, "x is north and y is east (NED), written as x east and y north"
    if frame == "image":
        down = [1.0, -1.0, 1.0][: values.shape[1]]
        return values * down, "y points down (pixels), written with the other sign"
    return values, "" if frame else "x east, y north is assumed: left is counter-clockwise"


def of_zones(table: Table, zones: pd.Series, values: FloatArray) -> FloatArray | None:
    """Return longitudes and latitudes (n, 2) [deg] of UTM positions in several zones, such as 32N;
    None in a single one.
    """
    parts = zones.str.extract(r"^(\d{1,2})\s*([A-Za-z]?)")
    if parts[0].nunique() < 2:
        return None
    degrees = np.full(values.shape, np.nan)
    for (zone, band), rows in parts.groupby([0, 1]).indices.items():
        if not 1 <= int(zone) <= 60:
            raise ArgumentError(f"{table.file}: zone {zone} is not allowed: expected 1 to 60")
        # Bands from N are in the north; S is one of these, and the word south.
        plane = pyproj.Proj(proj="utm", zone=int(zone), south="A" <= band.upper() < "N")
        east, north = values[rows].T
        degrees[rows] = np.column_stack(plane(east, north, inverse=True))
    return degrees
