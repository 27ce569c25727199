"""Which column holds what."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from baselines.recordings.reading.cells import Table, epoch_unit
from baselines.recordings.reading.names import INDEX, ROLES, plain_name, role_of
from hybrid_env.checks import ArgumentError, reject

# Value of --object for a file with one object.
ONE_OBJECT = "none"
PLANE, DEGREES, POLAR = {"x", "y"}, {"lat", "lon"}, {"range", "bearing"}


@dataclass
class Columns:
    """Numbers of columns from 0."""

    # The columns of `time`, `x`, `y`, `lat` and `lon`.
    roles: dict[str, int]
    # An index, whose whole numbers are ticks if there are no times.
    index: int | None = None
    # The column that tells objects apart.
    object: int | None = None
    # Names of the columns that are not used.
    left_out: list[str] = field(default_factory=list)
    # Whether the caller has named columns.
    chosen: bool = False


def find_columns(
    table: Table,
    columns: Mapping[str, str] | None,
    object_column: str | None,
    polar: bool = False,
) -> Columns:
    """Find the columns of times, positions, with `polar` those of a radar, and objects by their
    names.
    """
    names = {"time" if role == "t" else role: str(name) for role, name in (columns or {}).items()}
    for role in names:
        if role not in ROLES:
            raise reject("columns", role, f"names of columns for {', '.join(ROLES)}")
    if (
        names
        and not any(names.keys() >= axes for axes in (PLANE, DEGREES, POLAR))
        and set(names) != {"time"}
    ):
        raise reject(
            "columns",
            dict(columns or {}),
            "x and y, or lat and lon, and time where the file has times",
        )
    given = {role: numbered_column(table, "columns", name) for role, name in names.items()}
    found = Columns(_roles(table, given, polar), chosen=bool(given))
    used = set(found.roles.values())
    if object_column is None:
        found.object = object_column_of(table, used)
    elif object_column != ONE_OBJECT:
        found.object = numbered_column(table, "object", object_column)
    cells = table.frame[0]
    if (
        table.headed
        and 0 not in used
        and plain_name(table.names[0]) in INDEX
        and not cells.isna().all()
    ):
        if "time" not in found.roles and _is_time(cells):
            found.roles["time"] = 0
        else:
            found.index = 0
    kept = {*found.roles.values(), found.object, found.index}
    found.left_out = [table.label(k) for k in range(len(table.names)) if k not in kept]
    return found


def numbered_column(table: Table, option: str, name: str) -> int:
    """Return the number from 0 of a column that is given by its name or its number from 1."""
    wanted = name.strip().lower()
    found = [k for k, one in enumerate(table.names) if one.strip().lower() == wanted and wanted]
    if not found and wanted.isdigit() and 1 <= int(wanted[:9]) <= len(table.names):
        return int(wanted) - 1
    if len(found) != 1:
        several = "several columns have this name" if found else listed_columns(table)
        raise reject(option, name, f"a column of {table.file}, by name or number: {several}")
    return found[0]


def _roles(table: Table, given: dict[str, int], polar: bool) -> dict[str, int]:
    """Return the columns of time and positions: those that are given, and others by their names."""
    hint = "name them by --columns, for example --columns time=1 x=2 y=3"
    if not table.headed and not given:
        count = len(table.names)
        if count not in (2, 3):
            raise ArgumentError(f"{table.file}: {count} columns without names: {hint}")
        return dict(zip(("time", "x", "y")[-count:], range(count), strict=True))
    roles = dict(given)
    used = ("time", *(("range", "bearing", "rate") if polar else ("x", "y", "lat", "lon")))
    for role in ("time",) if set(given) - {"time"} else used:
        named = [
            k
            for k, name in enumerate(table.names)
            if role_of(name) == role and k not in given.values()
        ]
        if role in given or not named:
            continue
        if len(named) > 1:
            advice = f"choose by --columns, for example {role}={named[0] + 1}"
            raise ArgumentError(f"{table.file}: both {table.labels(named)} may be {role}: {advice}")
        roles[role] = named[0]
    found = [axes for axes in ((POLAR,) if polar else (PLANE, DEGREES)) if set(roles) >= axes]
    if not found:
        wanted = "range and bearing" if polar else "x, y or lat, lon"
        raise ArgumentError(f"{table.file}: no columns {wanted} ({listed_columns(table)}): {hint}")
    if len(found) > 1:
        lat = table.label(roles["lat"])
        lon = table.label(roles["lon"])
        advice = f"choose by --columns, for example lat={lat} lon={lon}"
        raise ArgumentError(f"{table.file}: it has x, y and lat, lon: {advice}")
    kept = {"time", *found[0], *(("rate",) if polar else ())}
    return {role: k for role, k in roles.items() if role in kept}


def object_column_of(table: Table, used: set[int]) -> int | None:
    """Return the column by whose values objects differ, by its name. One that is different in every
    row is a number of the row; one that is the same in every row names the object.
    """
    codes = {}
    for k, name in enumerate(table.names):
        cells = table.frame[k]
        if k in used or role_of(name) != "object":
            continue
        whole = not pd.api.types.is_float_dtype(cells) or (cells.dropna() % 1 == 0).all()
        if whole and cells.nunique() and (cells.nunique() < len(cells) or len(cells) == 1):
            codes[k] = pd.factorize(cells)[0]
    several = [k for k, code in codes.items() if code.max() > 0]
    for other in several[1:]:
        if not np.array_equal(codes[several[0]], codes[other]):
            labels = table.labels([several[0], other])
            raise ArgumentError(
                f"{table.file}: {labels} tell objects apart differently: choose by --object"
            )
    return next(iter([*several, *codes]), None)


def _is_time(cells: "pd.Series[object]") -> bool:
    """Whether an index without a name holds dates, and not numbers of rows."""
    if pd.api.types.is_datetime64_any_dtype(cells):
        return True
    if pd.api.types.is_numeric_dtype(cells):
        return epoch_unit(cells.to_numpy(np.float64, na_value=np.nan)) is not None
    dates = pd.to_datetime(
        cells.iloc[:1].astype("str"),
        format="ISO8601",
        utc=True,
        errors="coerce",
    )
    return bool(dates.notna().all())


def listed_columns(table: Table) -> str:
    """Return the names of the columns for a message."""
    # So many columns are listed in a message.
    listed = 8
    names = [name for name in table.names if name]
    if not names:
        return f"it has {len(table.names)} columns without names"
    return "its columns are " + ", ".join(names[:listed]) + (" ..." if len(names) > listed else "")
