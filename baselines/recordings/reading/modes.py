"""Reading a file of modes over time, true or stated: CSV, TSV or Parquet, also compressed."""

import os
import warnings
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from baselines.recordings.reading.cleaning import ordered_rows, remarks
from baselines.recordings.reading.columns import Columns, numbered_column, object_column_of
from baselines.recordings.reading.files import read_table
from baselines.recordings.reading.names import ONE_OBJECT, plain_name, role_of
from baselines.recordings.reading.read import cell_text, object_rows, read_times
from baselines.recordings.reading.table import Table
from baselines.recordings.reading.values import Times
from baselines.recordings.recording import dates_since
from hybrid_env.checks import ArgumentError, FloatArray, reject

# Names of columns of modes, in the order of preference.
MODES = (
    "mode modes true_mode truth stated statement statements predicted prediction label labels state"
    " states regime class manoeuvre maneuver phase"
)

WORDS = ("straight", "left", "right")


class ModeFile(NamedTuple):
    """What was read of a file, by the name of each track."""

    # Increasing [s]; datetimes if the file has dates.
    times: dict[str, FloatArray | NDArray[np.datetime64]]
    # As text, None for an empty cell.
    modes: dict[str, list[str | None]]

    @property
    def dated(self) -> bool:
        """Whether the times are dates."""
        return any(times.dtype.kind == "M" for times in self.times.values())

    def joined(self, other: "ModeFile") -> "ModeFile":
        """Return the tracks of this file and of another one."""
        return ModeFile(self.times | other.times, self.modes | other.modes)

    def like(self, truth: "ModeFile", name: str) -> "ModeFile":
        """Return the tracks of the truth, in its order, if all are here; of single ones the names
        may differ. The letters of `hybridtrack track` become the words straight, left and right of
        a truth that has these.
        """
        tracks = dict(zip(truth.times, self.times, strict=False))
        if len(self.times) > 1 or len(truth.times) > 1:
            tracks = {track: track for track in truth.times}
            missing = [track for track in truth.times if track not in self.times]
            if missing:
                allowed = f"every track of the truth, also {missing[0]}"
                raise reject(f"tracks of {name}", list(self.times), allowed)
        true = {mode for modes in truth.modes.values() for mode in modes if mode}
        words = {word[0].upper(): word for word in true if word.lower() in WORDS}
        letters = {letter: word for letter, word in words.items() if letter not in true}
        return ModeFile(
            {track: self.times[here] for track, here in tracks.items()},
            {
                track: [letters.get(mode or "", mode) for mode in self.modes[here]]
                for track, here in tracks.items()
            },
        )


def read_modes(
    path: str | os.PathLike[str],
    *,
    columns: Mapping[str, str] | None = None,
    object_column: str | None = None,
    time_unit: str | None = None,
    dated: bool = True,
) -> ModeFile:
    """Read the modes of a file.

    Args:
        path: the file, or a folder of results of `hybridtrack track`, whose files estimates.csv
            are read.
        columns: name or number (from 1) of the columns `time` and `mode`; None finds them by their
            names. The only column that is neither time nor object is that of the modes.
        object_column: as in `read_recordings`.
        time_unit: as in `read_recordings`.
        dated: which of several columns of times is read, one with dates or one with numbers.

    Raises:
        ArgumentError: the file cannot be read, or it is not clear what its columns mean.
    """
    if Path(path).is_dir():
        return _read_folder(
            Path(path),
            columns=columns,
            object_column=object_column,
            time_unit=time_unit,
            dated=dated,
        )
    table = read_table(path)
    given = {
        role: numbered_column(table, "columns", name) for role, name in (columns or {}).items()
    }
    for role in given:
        if role not in ("time", "mode"):
            raise reject("columns", role, "names of columns for time, mode")
    plain = [plain_name(name) for name in table.names]
    clocks: dict[str, list[int]] = {"time": [], "date": []}
    for k, name in enumerate(table.names):
        named = role_of(name)
        if named in clocks and k not in given.values():
            clocks[named].append(k)
    if "time" in given:
        clocks["time"] = [given["time"]]
    roles = {role: numbers[0] for role, numbers in clocks.items() if numbers}
    if not roles:
        raise ArgumentError(
            f"{table.file}: no column of times ({table.listed()}): name it by --columns, as time=1"
        )
    used = {*clocks["time"], *clocks["date"], *given.values()}
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
    free = [k for k in range(len(table.names)) if k not in {*used, number}]
    modes = [plain.index(name) for name in MODES.split() if name in plain]
    modes = [k for k in modes if k in free]
    if "mode" not in given and not modes and len(free) != 1:
        raise ArgumentError(
            f"{table.file}: no column of modes ({table.listed()}): name it by --columns, as mode=2"
        )
    mode = given["mode"] if "mode" in given else (modes or free)[0]
    times = _read_times(table, roles, clocks["time"], time_unit, dated)
    cells = table.frame[mode].astype(object)
    result = ModeFile({}, {})
    # From here on what is noted concerns rows that are samples.
    table = replace(table, notes=[], left_out={})
    for name, rows in object_rows(table, Columns(roles), Path(path)):
        ordered, seconds = ordered_rows(table, times.seconds, rows)
        instants: FloatArray | NDArray[np.datetime64] = seconds
        if times.epoch is not None:
            instants = dates_since(times.epoch, seconds)
        result.times[name] = instants
        result.modes[name] = [
            None if pd.isna(cells.iloc[row]) else cell_text(cells.iloc[row]) for row in ordered
        ]
    if said := remarks(table):
        warnings.warn(f"{table.file}: {'; '.join(said)}", stacklevel=2)
    return result


def _read_folder(folder: Path, **options: Any) -> ModeFile:
    """Read the results in a folder."""
    paths = sorted(folder.rglob("estimates.csv"))
    if not paths:
        raise reject("file", str(folder), "a folder with estimates.csv of hybridtrack track")
    result = ModeFile({}, {})
    for path in paths:
        file = read_modes(path, **options)
        for track in file.times:
            if track in result.times:
                raise reject("file", str(folder), f"a folder with one track {track}")
        result = result.joined(file)
    return result


def _read_times(
    table: Table, roles: dict[str, int], columns: list[int], unit: str | None, dated: bool
) -> Times:
    """Return the times of the column that has dates, or numbers, as asked for; otherwise of the
    first one that can be read.
    """
    readings = []
    for column in columns[1:] and columns:
        with suppress(ArgumentError):
            readings.append(read_times(table, Columns({**roles, "time": column}), unit))
    wanted = [times for times in readings if (times.epoch is not None) == dated]
    return [*wanted, *readings, read_times(table, Columns(roles), unit)][0]
