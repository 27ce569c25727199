"""What the names of columns mean."""

import functools
import re
from collections.abc import Sequence

from hybrid_env.checks import reject

# Names of the columns of times and positions, in lower case and joined by underscores.
ROLES = {
    "time": (
        "t",
        "time",
        "times",
        "timestamp",
        "datetime",
        "date_time",
        "date",
        "epoch",
        "ts",
        "unix",
        "unixtime",
        "unix_time",
        "posix",
        "utc",
        "elapsed",
        "elapsed_time",
        "basedatetime",
        "sec",
        "secs",
        "seconds",
        "millis",
        "milliseconds",
        "gps_time",
        "utc_time",
        "time_utc",
    ),
    "x": (
        "x",
        "easting",
        "east",
        "e",
        "pos_x",
        "x_pos",
        "posx",
        "position_x",
        "x_position",
        "px",
        "utm_easting",
        "utm_e",
        "utm_x",
        "x_coordinate",
        "coord_x",
    ),
    "y": (
        "y",
        "northing",
        "north",
        "n",
        "pos_y",
        "y_pos",
        "posy",
        "position_y",
        "y_position",
        "py",
        "utm_northing",
        "utm_n",
        "utm_y",
        "y_coordinate",
        "coord_y",
    ),
    "lat": (
        "lat",
        "latitude",
        "location_lat",
        "position_lat",
        "gps_lat",
        "gps_latitude",
        "lats",
        "latitudes",
    ),
    "lon": (
        "lon",
        "lng",
        "long",
        "longitude",
        "location_long",
        "location_lon",
        "position_long",
        "position_lon",
        "gps_lon",
        "gps_long",
        "gps_longitude",
        "lons",
        "longitudes",
    ),
    "range": ("range", "rng", "rho", "distance", "slant_range", "measured_range"),
    "bearing": ("bearing", "brg", "azimuth", "az", "measured_bearing"),
    "rate": ("range_rate", "rangerate", "doppler", "radial_velocity", "radial_speed", "rdot"),
}

# Names of columns that tell objects apart.
OBJECTS = (
    "object",
    "object_id",
    "obj",
    "obj_id",
    "id",
    "track_id",
    "trackid",
    "target",
    "target_id",
    "vehicle",
    "vehicle_id",
    "agent",
    "agent_id",
    "ship",
    "ship_id",
    "mmsi",
    "icao24",
    "icao",
    "hex",
    "callsign",
    "flight",
    "flight_id",
    "individual",
    "individual_local_identifier",
    "tag_local_identifier",
    "animal",
    "animal_id",
    "name",
    "ped_id",
    "pedestrian_id",
    "person",
    "person_id",
    "pid",
    "uid",
    "uuid",
    "tag",
    "tag_id",
)
ROLE_OF = {name: role for role, names in (ROLES | {"object": OBJECTS}).items() for name in names}
# Names of an index: the number of the row, as spreadsheets and pandas write it.
INDEX = ("", "unnamed_0", "index", "row", "nr", "no")
DEGREES = ("deg", "degree", "degrees", "°")
LENGTHS = (
    "m",
    "km",
    "cm",
    "mm",
    "um",
    "ft",
    "yd",
    "mi",
    "nmi",
    "px",
    "rad",
    "mrad",
    "mil",
    "mils",
    "gon",
    "grad",
    *DEGREES,
)
# Units of time [s].
SECONDS = {
    "s": 1.0,
    "sec": 1.0,
    "secs": 1.0,
    "seconds": 1.0,
    "ms": 1e-3,
    "msec": 1e-3,
    "millis": 1e-3,
    "milliseconds": 1e-3,
    "us": 1e-6,
    "µs": 1e-6,
    "μs": 1e-6,
    "ns": 1e-9,
    "min": 60.0,
    "minutes": 60.0,
    "h": 3600.0,
    "hours": 3600.0,
}


def plain_name(name: str) -> str:
    """Return a name in lower case, its words joined by underscores."""
    return re.sub(r"[\s_.:-]+", "_", name.strip().lower()).strip("_")


@functools.lru_cache(maxsize=256)
def split_unit(name: str) -> tuple[str, str | None]:
    """Return the plain name of a column and its unit, None if it has none. The unit is in brackets
    or after a slash, as in `x [m]`, `x (km)` and `t/s`, or a known one after an underscore, as in
    `t_ms`.
    """
    found = re.fullmatch(r"\s*(.+?)\s*(?:\[(.*)\]|\((.*)\)|/\s*(\w+))\s*", name)
    if found:
        unit = next(part for part in found.groups()[1:] if part is not None).strip()
        return plain_name(found[1]), unit or None
    plain = plain_name(name)
    base, _, unit = plain.rpartition("_")
    if base and (unit in SECONDS or unit in LENGTHS) and ROLE_OF.get(plain) not in ROLES:
        return base, unit
    return plain, "ms" if plain in ("millis", "milliseconds") else None


def role_of(name: str) -> str | None:
    """Return the role of a column by its name: one of `ROLES`, `object`, or None if it has none."""
    return ROLE_OF.get(split_unit(name)[0])


def columns_by_role(texts: Sequence[str], roles: Sequence[str]) -> dict[str, str]:
    """Return the columns that texts such as `time=3` name, by role."""
    columns: dict[str, str] = {}
    for text in texts:
        role, sign, column = text.partition("=")
        if not sign or role not in roles or not column:
            raise reject("columns", text, f"role=column with a role of {', '.join(roles)}")
        if role in columns:
            raise reject("columns", text, f"one column for {role}")
        columns[role] = column
    return columns
