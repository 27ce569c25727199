"""Reading a file of modes over time, true or stated: CSV, TSV or Parquet, also compressed."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from baselines.recordings.reading.cleaning import ordered_rows
from baselines.recordings.reading.columns import Columns, numbered_column, object_column_of
from baselines.recordings.reading.files import read_table
from baselines.recordings.reading.names import ONE_OBJECT, plain_name, role_of
from baselines.recordings.reading.read import cell_text, object_rows, read_times
from hybrid_env.checks import ArgumentError, FloatArray, reject

# Names of columns of modes, in the order of preference.
MODES = (
    "mode modes true_mode truth stated statement statements predicted prediction label labels state"
    " states regime class manoeuvre maneuver phase"
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
            allowed = f"every track of the truth, also {missing[0]}"
            raise reject(f"tracks of {name}", list(self.times), allowed)
        return ModeFile(
            {track: self.times[track] for track in other.times},
            {track: self.modes[track] for track in other.times},
        )


def read_modes(
    path: str | os.PathLike[str],
    *,
    columns: Mapping[str, str] | None = None,
    object_column: str | None = None,
    time_unit: str | None = None,
) -> ModeFile:
    """Read the modes of a file.

    Args:
        path: the file.
        columns: name or number (from 1) of the columns `time` and `mode`; None finds them by their
            names. The only column that is neither time nor object is that of the modes.
        object_column: as in `read_recordings`.
        time_unit: as in `read_recordings`.

    Raises:
        ArgumentError: the file cannot be read, or it is not clear what its columns mean.
    """
    table = read_table(path)
    given = {
        role: numbered_column(table, "columns", name) for role, name in (columns or {}).items()
    }
    for role in given:
        if role not in ("time", "mode"):
            raise reject("columns", role, "names of columns for time, mode")
    plain = [plain_name(name) for name in table.names]
    roles: dict[str, int] = {}
    for k, name in enumerate(table.names):
        named = role_of(name)
        if named in ("time", "date") and k not in given.values():
            roles.setdefault(named, k)
    roles |= {role: k for role, k in given.items() if role == "time"}
    if "time" not in roles and "date" not in roles:
        raise ArgumentError(
            f"{table.file}: no column of times ({table.listed()}): name it by --columns, as time=1"
        )
    used = {*roles.values(), *given.values()}
    if object_column is None:
        tracks = [
            k for k, name in enumerate(plain) if name in ("track", "episode") and k not in used
        ]
        number = tracks[0] if tracks else object_column_of(table, used)
    else:
        marked = object_column != ONE_OBJECT
        number = numbered_column(table, "object", object_column) if marked else None
    if number is not None:
        roles["object"] = number
    free = [k for k in range(len(table.names)) if k not in roles.values()]
    modes = [plain.index(name) for name in MODES.split() if name in plain]
    modes = [k for k in modes if k in free]
    if "mode" not in given and not modes and len(free) != 1:
        raise ArgumentError(
            f"{table.file}: no column of modes ({table.listed()}): name it by --columns, as mode=2"
        )
    mode = given["mode"] if "mode" in given else (modes or free)[0]
    times = read_times(table, Columns(roles), time_unit)
    cells = table.frame[mode].astype(object)
    result = ModeFile({}, {})
    for name, rows in object_rows(table, Columns(roles), Path(path)):
        ordered, seconds = ordered_rows(table, times.seconds, rows)
        instants: FloatArray | NDArray[np.datetime64] = seconds
        if times.epoch is not None:
            passed = np.round(seconds * 1e9).astype("timedelta64[ns]")
            instants = np.datetime64(times.epoch.removesuffix("Z"), "ns") + passed
        result.times[name] = instants
        result.modes[name] = [
            None if pd.isna(cells.iloc[row]) else cell_text(cells.iloc[row]) for row in ordered
        ]
    return result
