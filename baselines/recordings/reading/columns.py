"""What the columns of a file mean, by their names or as the caller says."""

import re
from collections.abc import Mapping, Sequence

from baselines.recordings.reading.names import ONE_OBJECT, role_of, split_unit
from baselines.recordings.reading.table import Table
from baselines.recordings.reading.values import parted_places
from hybrid_env.checks import ArgumentError, reject

# Of a measured velocity; the first ones that a file has are read.
MOTIONS = (("vx", "vy"), ("speed", "course"), ("speed", "heading"), ("speed", "bearing"))
# What is read beside a position and a velocity.
BESIDE = ["z", "zone", "time", "date", "fix_time", "index", "north_south", "east_west", "object"]
# Names of times.
CLOCK = r"(?:^|_)(?:(?:date_?)?time(?:_?stamp)?s?|at)$"


def find_columns(
    table: Table,
    columns: Mapping[str, str] | None,
    object_column: str | None,
    axes: Sequence[tuple[str, ...]],
) -> None:
    """Find the columns of times, positions and objects of a table, by their names or as they are
    given.

    Args:
        table: cells of the file, which get their roles.
        columns: name or number from 1 of the column of a role, `none` to read no such column.
        object_column: the same of the column that tells objects apart, `none` without one.
        axes: groups of roles, of which one is a position, or `mode` in a file of modes.

    Raises:
        ArgumentError: there is no such group.
    """
    wanted = {"time" if role == "t" else role: str(name) for role, name in (columns or {}).items()}
    if object_column is not None:
        wanted["object"] = object_column
    given = {
        role: numbered_column(table, "object" if role == "object" else "columns", name)
        for role, name in wanted.items()
        if name != ONE_OBJECT
    }
    example = " ".join(f"{role}={number}" for number, role in enumerate(axes[0], start=2))
    hint = f"name them by --columns, for example --columns time=1 {example}"
    count = len(table.names)
    if not table.headed and not columns:
        if count not in (2, 3):
            raise ArgumentError(f"{count} columns without names: {hint}")
        given |= zip(("time", "x", "y")[-count:], range(count), strict=True)
    found = {role: [k] for role, k in given.items()}
    for k, name in enumerate(table.names):
        role = role_of(name)
        free = k not in given.values() and role not in {None, *wanted}
        if role is not None and free and table.frame[k].notna().any():
            found.setdefault(role, []).append(k)
    alone = "position" in found and not found.keys() & {"x", "lat"}
    if "position" in given or (alone and ("lat", "lon") in axes):
        table.roles["position"] = k = found["position"][0]
        for role, cells in zip(("lat", "lon"), parted_places(table.frame[k]), strict=True):
            found[role] = [table.add(f"{role} of {table.label(k)}", cells)]
    if not found.keys() & {"time", "date", "fix_time"}:
        # Under another name, such as `acquisition time`.
        timed = [k for k, name in enumerate(table.names) if re.search(CLOCK, split_unit(name)[0])]
        if timed:
            found["time"] = timed[:1]
            table.notes.append(f"{table.label(timed[0])!r} taken as time (--columns)")
    pairs = [pair for pair in axes if found.keys() >= {*pair}]
    if not pairs:
        choice = ", or ".join(" and ".join(pair) for pair in axes)
        raise ArgumentError(f"no columns {choice} ({table.listed()}): {hint}")
    # Metres on a plane are more exact than the degrees beside them.
    pair = max(pairs, key=lambda pair: given.keys() >= {*pair})
    motion = next((pair for pair in MOTIONS if found.keys() >= {*pair}), ())
    kept = [role for role in (*pair, *motion, *BESIDE) if role in found]
    for role in sorted(kept, key=[*given, *kept].index):
        different = {k: table.frame[k].nunique() for k in found[role]}
        if role == "object" and role not in given:
            # What differs in every row is a number of the row.
            different = {k: n for k, n in different.items() if n < max(table.frame[k].count(), 2)}
        if not different:
            continue
        # Times are the finest ones; a place that is the same in every row is that of the start.
        most = max(different.values())
        enough = most if role == "time" else min(2, most)
        table.roles[role] = first = next(k for k, n in different.items() if n >= enough)
        taken, *others = (
            f"{table.label(k)!r} (column {k + 1})" for k in sorted(different, key=first.__ne__)
        )
        if others:
            option = "--object" if role == "object" else "--columns"
            table.notes.append(f"{taken} taken as {role}, not {' or '.join(others)} ({option})")


def numbered_column(table: Table, option: str, name: str) -> int:
    """Return the number from 0 of a column that is given by its name or its number from 1."""
    wanted = name.strip().lower()
    same = [k for k, other in enumerate(table.names) if wanted and other.strip().lower() == wanted]
    if wanted.isdigit() and 1 <= int(wanted[:9]) <= len(table.names):
        same = same or [int(wanted) - 1]
    if len(same) != 1:
        listed = table.listed()
        raise reject(option, name, f"one column of the file, by name or number: {listed}")
    return same[0]
