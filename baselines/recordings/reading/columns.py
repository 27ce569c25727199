"""What the columns of a file mean, by their names or as the caller says."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from baselines.recordings.reading.names import GIVEN_ROLES, ONE_OBJECT, role_of
from baselines.recordings.reading.table import Table
from baselines.recordings.reading.values import parse_numbers, parse_times
from hybrid_env.checks import ArgumentError, reject

MODE = (("mode",),)


def find_columns(
    table: Table,
    columns: Mapping[str, str] | None,
    object_column: str | None,
    axes: Sequence[tuple[str, ...]],
) -> dict[str, int]:
    """Return the numbers of the columns, from 0, of times, positions and objects by their role: by
    their names, or as they are given.

    Args:
        table: cells of the file.
        columns: name or number from 1 of the column of a role.
        object_column: the same of the column that tells objects apart, `none` without one.
        axes: groups of roles, of which one is a position; or `MODE`, for a file of modes.

    Raises:
        ArgumentError: there is no such group, or several columns for one role.
    """
    given = {
        "time" if role == "t" else role: numbered_column(table, "columns", str(name))
        for role, name in (columns or {}).items()
    }
    allowed = ("time", "mode") if axes == MODE else GIVEN_ROLES
    for role in given:
        if role not in allowed:
            raise reject("columns", role, f"names of columns for {', '.join(allowed)}")
    example = " ".join(f"{role}={number}" for number, role in enumerate(axes[0], start=2))
    hint = f"name them by --columns, for example --columns time=1 {example}"
    roles = dict(given)
    if not table.headed and not given:
        count = len(table.names)
        if count not in (2, 3):
            raise ArgumentError(f"{table.file}: {count} columns without names: {hint}")
        roles = dict(zip(("time", "x", "y")[-count:], range(count), strict=True))
    found: dict[str, list[int]] = {}
    for k, name in enumerate(table.names):
        named = role_of(name)
        if named is not None and named not in roles and k not in given.values():
            found.setdefault(named, []).append(k)
    pairs = [pair for pair in axes if {*roles, *found} >= {*pair}]
    chosen = [pair for pair in pairs if {*given} >= {*pair}]
    if not pairs:
        wanted = ", or ".join(" and ".join(pair) for pair in axes)
        raise ArgumentError(f"{table.file}: no columns {wanted} ({table.listed()}): {hint}")
    # Metres on a plane are more exact than the degrees beside them.
    kept = (*(chosen or pairs)[0], "time", "date", "fix_time", "index", "north_south", "east_west")
    roles = {role: k for role, k in roles.items() if role in kept}
    for role, numbers in found.items():
        if role not in kept:
            continue
        different = [table.frame[k].nunique() for k in numbers]
        # Times are the finest ones; a place that is the same in every row is that of the start.
        best = max(different) if role == "time" else min(2, max(different))
        roles[role] = next(k for k, count in zip(numbers, different, strict=True) if count >= best)
        others = [place_of(table, k) for k in numbers if k != roles[role]]
        if others:
            taken = place_of(table, roles[role])
            table.notes.append(f"{taken} taken as {role}, not {' or '.join(others)} (--columns)")
    if table.headed and "" in table.names and not {*roles.values()} & {table.names.index("")}:
        nameless = table.names.index("")
        rest = parse_numbers(table.frame[nameless])[0] % 1.0
        if (rest == 0.0).all():
            roles.setdefault("index", nameless)
        elif not np.isnan(parse_times(table.frame[nameless]).seconds).all():
            roles.setdefault("time", nameless)
    number = None
    if object_column is None:
        number = object_column_of(table, {*roles.values()})
    elif object_column != ONE_OBJECT:
        number = numbered_column(table, "object", object_column)
    return roles if number is None else {**roles, "object": number}


def place_of(table: Table, column: int) -> str:
    """Return name and number of a column for a message."""
    return f"{table.label(column)!r} (column {column + 1})"


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
        cells = table.frame[k].dropna()
        if k in used or role_of(name) != "object" or cells.empty:
            continue
        whole = not pd.api.types.is_float_dtype(cells) or not (cells % 1.0).any()
        if whole and (cells.nunique() < len(cells) or len(cells) == 1):
            codes[k] = pd.factorize(table.frame[k])[0]
    several = [k for k, code in codes.items() if code.max() > 0]
    for other in several[1:]:
        if not np.array_equal(codes[several[0]], codes[other]):
            both = f"{table.label(several[0])!r} and {table.label(other)!r}"
            raise ArgumentError(
                f"{table.file}: {both} tell objects apart differently: choose by --object"
            )
    return next(iter([*several, *codes]), None)
