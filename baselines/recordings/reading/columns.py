"""What the columns of a file mean, by their names or as the caller says."""

import re
from collections.abc import Mapping, Sequence

from baselines.recordings.reading.names import ONE_OBJECT, role_of, split_unit
from baselines.recordings.reading.table import Table
from baselines.recordings.reading.values import parted_places
from hybrid_env.checks import ArgumentError, reject

# Of a measured velocity; the first ones that a file has are read.
MOTIONS = (("vx", "vy"), ("speed", "course"), ("speed", "heading"), ("speed", "bearing"))


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
        columns: name or number from 1 of the column of a role, `none` to read no such column.
        object_column: the same of the column that tells objects apart, `none` without one.
        axes: groups of roles, of which one is a position, or `mode` in a file of modes.

    Raises:
        ArgumentError: there is no such group.
    """
    given = {
        "time" if role == "t" else role: numbered_column(table, "columns", str(name))
        for role, name in (columns or {}).items()
        if name != ONE_OBJECT
    }
    example = " ".join(f"{role}={number}" for number, role in enumerate(axes[0], start=2))
    hint = f"name them by --columns, for example --columns time=1 {example}"
    roles, count = given, len(table.names)
    if not table.headed and not given:
        if count not in (2, 3):
            raise ArgumentError(f"{table.file}: {count} columns without names: {hint}")
        roles = dict(zip(("time", "x", "y")[-count:], range(count), strict=True))
    found: dict[str, list[int]] = {}
    for k in sorted({*range(count)} - {*roles.values()}):
        named = role_of(table.names[k])
        without = (columns or {}).get(named or "") == ONE_OBJECT
        if named is not None and not without and table.frame[k].notna().any():
            found.setdefault(named, []).append(k)
    known = {*roles, *found}
    if "position" in roles or (
        ("lat", "lon") in axes and "position" in known and not known & {"x", "lat"}
    ):
        roles["position"] = k = roles.get("position", found.get("position", [0])[0])
        for role, cells in zip(("lat", "lon"), parted_places(table.frame[k]), strict=True):
            found[role] = [table.add(f"{role} of {table.label(k)}", cells)]
    # Names of times.
    clock = r"(?:^|_)(?:(?:date_?)?time(?:_?stamp)?s?|at)$"
    if not {"time", "date", "fix_time"} & {*roles, *found}:
        # Under another name, such as `acquisition time`.
        timed = [k for k, name in enumerate(table.names) if re.search(clock, split_unit(name)[0])]
        if timed:
            roles["time"] = timed[0]
            table.notes.append(f"{table.label(timed[0])!r} taken as time (--columns)")
    pairs = [pair for pair in axes if {*roles, *found} >= {*pair}]
    if not pairs:
        wanted = ", or ".join(" and ".join(pair) for pair in axes)
        raise ArgumentError(f"{table.file}: no columns {wanted} ({table.listed()}): {hint}")
    # Metres on a plane are more exact than the degrees beside them.
    pair = max(pairs, key=lambda pair: {*given} >= {*pair})
    motion = next((pair for pair in MOTIONS if {*roles, *found} >= {*pair}), ())
    kept = [
        *pair,
        *motion,
        "z",
        "zone",
        "position",
        "time",
        "date",
        "fix_time",
        "index",
        "north_south",
        "east_west",
    ]
    roles = {role: k for role, k in roles.items() if role in kept}
    if object_column is None:
        kept.append("object")
    elif object_column != ONE_OBJECT:
        roles["object"] = numbered_column(table, "object", object_column)
    counts = table.frame.count()
    for role in kept:
        candidates = found.get(role, ())
        # A single one need not be compared.
        compared = role == "object" or len(candidates) > 1
        different = {k: table.frame[k].nunique() if compared else 1 for k in candidates}
        if role == "object":
            # What differs in every row is a number of the row.
            different = {k: n for k, n in different.items() if n < max(counts[k], 2)}
        if role in roles or not different or role == "position":
            continue
        # Times are the finest ones; a place that is the same in every row is that of the start.
        most = max(different.values())
        enough = most if role == "time" else min(2, most)
        roles[role] = first = next(k for k, count in different.items() if count >= enough)
        taken, *others = (
            f"{table.label(k)!r} (column {k + 1})" for k in sorted(different, key=first.__ne__)
        )
        if others:
            option = "--object" if role == "object" else "--columns"
            table.notes.append(f"{taken} taken as {role}, not {' or '.join(others)} ({option})")
    return roles


def numbered_column(table: Table, option: str, name: str) -> int:
    """Return the number from 0 of a column that is given by its name or its number from 1."""
    wanted = name.strip().lower()
    same = [k for k, other in enumerate(table.names) if wanted and other.strip().lower() == wanted]
    if wanted.isdigit() and 1 <= int(wanted[:9]) <= len(table.names):
        same = same or [int(wanted) - 1]
    if len(same) != 1:
        listed = table.listed()
        raise reject(option, name, f"one column of {table.file}, by name or number: {listed}")
    return same[0]
