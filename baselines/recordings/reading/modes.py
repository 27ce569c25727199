"""Reading a file of modes over time, true or stated: CSV, TSV or Parquet, also compressed by
gzip.
"""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from baselines.recordings.reading.cells import parse_times
from baselines.recordings.reading.columns import (
    ONE_OBJECT,
    Columns,
    listed_columns,
    numbered_column,
    object_column_of,
)
from baselines.recordings.reading.files import read_table
from baselines.recordings.reading.names import plain_name, role_of
from baselines.recordings.reading.read import cell_text, check_order, object_rows
from hybrid_env.checks import ArgumentError, FloatArray, reject

# Names of columns of modes, in the order of preference.
MODES = (
    "mode",
    "modes",
    "true_mode",
    "truth",
    "stated",
    "statement",
    "statements",
    "predicted",
    "prediction",
    "label",
    "labels",
    "state",
    "states",
    "regime",
    "class",
    "manoeuvre",
    "maneuver",
    "phase",
)


class ModeFile(NamedTuple):
    """What was read of a file, by the name of each track."""

    # Increasing [s]; datetimes if the file has dates.
    times: dict[str, FloatArray | NDArray[np.datetime64]]
    # As text, None for an empty cell.
    modes: dict[str, list[str | None]]

    def like(self, other: "ModeFile", name: str) -> "ModeFile":
        """Return the tracks of another file, in its order, if all are here; of single ones the
        names may differ.
        """
        if len(self.times) == len(other.times) == 1:
            return self
        missing = [track for track in other.times if track not in self.times]
        if missing:
            raise reject(
                f"tracks of {name}",
                list(self.times),
                f"every track of the truth, also {missing[0]}",
            )
        order = list(other.times)
        return ModeFile(
            {one: self.times[one] for one in order},
            {one: self.modes[one] for one in order},
        )


def read_modes(
    path: str | os.PathLike[str],
    *,
    columns: Mapping[str, str] | None = None,
    object_column: str | None = None,
    time_unit: str | None = None,
) -> ModeFile:
    """Read the modes of a file; what is not clear raises `ArgumentError`. Columns are the name or
    number (from 1) of the columns `time` and `mode`; None finds them by their names. The only
    column that is neither time nor object is that of the modes, whatever its name is. The others
    are as in `read_recordings`.
    """
    table = read_table(path)
    given = {
        role: numbered_column(table, "columns", name) for role, name in (columns or {}).items()
    }
    for role in given:
        if role not in ("time", "mode"):
            raise reject("columns", role, "names of columns for time, mode")
    named = (
        [given["time"]]
        if "time" in given
        else [k for k, one in enumerate(table.names) if role_of(one) == "time"]
    )
    if len(named) != 1:
        why = f"both {table.labels(named)} may be it" if named else listed_columns(table)
        raise ArgumentError(
            f"{table.file}: no column of times ({why}): name it by --columns, as time=1"
        )
    (time,) = named
    used = {time, *given.values()}
    tracks = None
    if object_column is None:
        # Names of columns that tell tracks apart, beside those of objects.
        of_tracks = [
            k
            for k, one in enumerate(table.names)
            if plain_name(one) in ("track", "episode") and k not in used
        ]
        tracks = of_tracks[0] if of_tracks else object_column_of(table, used)
    elif object_column != ONE_OBJECT:
        tracks = numbered_column(table, "object", object_column)
    free = [k for k in range(len(table.names)) if k not in (time, tracks)]
    plain = {plain_name(table.names[k]): k for k in reversed(free)}
    modes = [plain[name] for name in MODES if name in plain]
    if "mode" not in given and not modes and len(free) != 1:
        advice = f"({listed_columns(table)}): name it by --columns, as mode=2"
        raise ArgumentError(f"{table.file}: no column of modes {advice}")
    mode = given["mode"] if "mode" in given else (modes or free)[0]
    times = parse_times(table, time, time_unit)
    seconds: FloatArray | NDArray[np.datetime64] = times.seconds
    if times.epoch is not None:
        passed = np.round(times.seconds * 1e9).astype("timedelta64[ns]")
        seconds = np.datetime64(times.epoch.removesuffix("Z"), "ns") + passed
    cells = [
        None if pd.isna(cell) else cell_text(cell) for cell in table.frame[mode].astype(object)
    ]
    found = ModeFile({}, {})
    for name, rows in object_rows(table, tracks, Path(path)):
        check_order(table, Columns({"time": time}, object=tracks), times.seconds, rows, name)
        found.times[name] = seconds[rows]
        found.modes[name] = [cells[row] for row in rows]
    return found
