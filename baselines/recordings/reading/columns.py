"""What the columns of a file mean, by their names or as the caller says."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from baselines.recordings.reading.names import (
    GIVEN_ROLES,
    ONE_OBJECT,
    PARTS,
    SECONDS,
    plain_name,
    role_of,
    split_unit,
)
from baselines.recordings.reading.table import Table
from baselines.recordings.reading.values import parse_numbers
from hybrid_env.checks import ArgumentError, reject


@dataclass
class Columns:
    """Numbers of columns, from 0, by role."""

    roles: dict[str, int]
    # Names of the columns that are not used.
    unused: list[str] = field(default_factory=list)
    # Whether the caller has named columns.
    chosen: bool = False


def find_columns(
    table: Table,
    columns: Mapping[str, str] | None,
    object_column: str | None,
    axes: Sequence[tuple[str, ...]] = (("x", "y"), ("lat", "lon")),
) -> Columns:
    """Find the columns of times, positions and objects by their names, or as they are given.

    Args:
        table: cells of the file.
        columns: name or number from 1 of the column of a role.
        object_column: the same of the column that tells objects apart, `none` without one.
        axes: pairs of roles, of which one is a position.

    Raises:
        ArgumentError: there are no positions, or several columns for one role.
    """
    given = {
        "time" if role == "t" else role: numbered_column(table, "columns", str(name))
        for role, name in (columns or {}).items()
    }
    for role in given:
        if role not in GIVEN_ROLES:
            raise reject("columns", role, f"names of columns for {', '.join(GIVEN_ROLES)}")
    example = " ".join(f"{role}={number}" for number, role in enumerate(axes[0], start=2))
    hint = f"name them by --columns, for example --columns time=1 {example}"
    roles = dict(given)
    if not table.headed and not given:
        count = len(table.names)
        if count not in (2, 3):
            raise ArgumentError(f"{table.file}: {count} columns without names: {hint}")
        roles = dict(zip(("time", "x", "y")[-count:], range(count), strict=True))
    if not {"lat", "lon"} <= {*map(role_of, table.names)}:
        _split_positions(table)
    doubles: dict[str, int] = {}
    for k, name in enumerate(table.names):
        named = role_of(name)
        if plain_name(name) == "mm":
            named = "minute" if {"month", "hour"} & {*roles} else "month"
        if named is None or named == "object" or named in given or k in given.values():
            continue
        if named == "fraction" and not _is_fraction(table, k):
            named = "time"
        if named == "time" and named in roles and _is_fraction(table, k):
            named = "fraction"
        elif named == "time" and named in roles:
            # Of several columns of times that with the finest ones.
            roles[named] = max(roles[named], k, key=lambda number: table.frame[number].nunique())
        elif named in roles and table.frame[roles[named]].nunique() <= 1:
            # The place of the start, or an empty column.
            roles[named] = k
        elif named in roles and table.frame[k].nunique() > 1:
            doubles.setdefault(named, k)
        roles.setdefault(named, k)
    pairs = [pair for pair in axes if set(roles) >= set(pair)]
    chosen = [pair for pair in pairs if set(given) >= set(pair)]
    if not pairs:
        wanted = ", or ".join(" and ".join(pair) for pair in axes)
        raise ArgumentError(f"{table.file}: no columns {wanted} ({table.listed()}): {hint}")
    # Metres on a plane are more exact than the degrees beside them.
    kept = {
        *(chosen or pairs)[0],
        *("time", "date", "fix_time", "week", "fraction", "index", "valid"),
        *("north_south", "east_west", *PARTS),
    }
    roles = {role: k for role, k in roles.items() if role in kept}
    for role in sorted({*roles} & {*doubles} & {*GIVEN_ROLES}):
        first, second = (table.label(columns[role]) for columns in (roles, doubles))
        place = f"column {doubles[role] + 1}" if first == second else repr(second)
        table.notes.append(f"{first!r} taken as {role}, not {place} (--columns)")
    if table.headed and not table.names[0].strip() and 0 not in roles.values():
        roles["time" if "time" not in roles and _is_time(table.frame[0]) else "index"] = 0
    if object_column is None:
        number = object_column_of(table, set(roles.values()))
    else:
        number = (
            None if object_column == ONE_OBJECT else numbered_column(table, "object", object_column)
        )
    if number is not None:
        roles["object"] = number
    unused = [table.label(k) for k in range(len(table.names)) if k not in roles.values()]
    return Columns(roles, unused, bool(given))


def _is_fraction(table: Table, column: int) -> bool:
    """Whether a column has parts of a second, beside times of whole seconds."""
    unit = SECONDS.get(split_unit(table.names[column])[1] or "s", 1.0)
    if unit == 1.0:
        return False
    numbers, _, _ = parse_numbers(table.frame[column])
    return bool(0.0 <= unit * np.nanmax(numbers, initial=-1.0) < 1.0)


def _split_positions(table: Table) -> None:
    """Add columns of latitude and longitude, if there is a column of texts that hold both."""
    pair = r"^[^\d+-]*([-+]?\d+\.\d+)[^\d.+-]+([-+]?\d+\.\d+)\W*$"
    for k, name in enumerate(table.names):
        if role_of(name) == "position" and not pd.api.types.is_numeric_dtype(table.frame[k]):
            # "POINT (8.1 47.2)" and GeoJSON begin with the longitude.
            texts = table.frame[k].astype("str").str.strip()
            points = texts.str.match(r"(?i)point|.*coordinates|\W*(lon|lng)")
            parts = texts.str.extract(pair)
            count = len(table.names)
            table.frame[count] = parts[0].where(~points, parts[1])
            table.frame[count + 1] = parts[1].where(~points, parts[0])
            table.names = (*table.names, "lat", "lon")
            return


def numbered_column(table: Table, option: str, name: str) -> int:
    """Return the number from 0 of a column that is given by its name or its number from 1."""
    wanted = name.strip().lower()
    same = [k for k, other in enumerate(table.names) if other.strip().lower() == wanted and wanted]
    if not same and wanted.isdigit() and 1 <= int(wanted[:9]) <= len(table.names):
        return int(wanted) - 1
    if len(same) != 1:
        several = "several columns have this name" if same else table.listed()
        raise reject(option, name, f"a column of {table.file}, by name or number: {several}")
    return same[0]


def object_column_of(table: Table, used: set[int]) -> int | None:
    """Return the column by whose values objects differ, by its name. One that is different in every
    row is a number of the row; one that is the same in every row names the object.
    """
    codes = {}
    for k, name in enumerate(table.names):
        cells = table.frame[k]
        if k in used or role_of(name) != "object":
            continue
        whole = not pd.api.types.is_float_dtype(cells) or bool((cells.dropna() % 1 == 0).all())
        if whole and cells.nunique() and (cells.nunique() < len(cells) or len(cells) == 1):
            codes[k] = pd.factorize(cells)[0]
    several = [k for k, code in codes.items() if code.max() > 0]
    for other in several[1:]:
        if not np.array_equal(codes[several[0]], codes[other]):
            both = f"{table.label(several[0])!r} and {table.label(other)!r}"
            raise ArgumentError(
                f"{table.file}: {both} tell objects apart differently: choose by --object"
            )
    return next(iter([*several, *codes]), None)


def _is_time(cells: "pd.Series[object]") -> bool:
    """Whether an index without a name holds dates or times, and not numbers of rows."""
    if pd.api.types.is_datetime64_any_dtype(cells):
        return True
    numbers = pd.to_numeric(cells, errors="coerce")
    if numbers.notna().mean() > 0.5:
        return bool((numbers.dropna() % 1 != 0).any())
    return bool(pd.to_datetime(cells.head(9), format="ISO8601", errors="coerce").notna().any())
