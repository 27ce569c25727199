"""Reading a file of modes over time, true or stated: CSV, TSV or Parquet, also compressed."""

import os
import warnings
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from baselines.recordings.reading.cleaning import remarks, sorted_rows
from baselines.recordings.reading.columns import find_columns
from baselines.recordings.reading.files import read_table
from baselines.recordings.reading.names import ROW_FILES, plain_name, role_of
from baselines.recordings.reading.read import cell_text, object_rows, read_times
from baselines.recordings.reading.table import REPEATED
from baselines.recordings.recording import dates_since
from hybrid_env.checks import ArgumentError, FloatArray, reject


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
        one = len(self.times) == len(truth.times) == 1
        tracks = dict(zip(truth.times, self.times if one else truth.times, strict=True))
        missing = [here for here in tracks.values() if here not in self.times]
        if missing:
            allowed = f"every track of the truth, also {missing[0]}"
            raise reject(f"tracks of {name}", list(self.times), allowed)
        true = {mode for modes in truth.modes.values() for mode in modes if mode}
        turns = "straight", "left", "right"
        words = {word[0].upper(): word for word in true if word.lower() in turns}
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
            or estimates.parquet are read.
        columns: name or number (from 1) of the columns `time` and `mode`; None finds them by their
            names.
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
    names = [plain_name(name) for name in table.names]
    clocks = [k for k, name in enumerate(table.names) if role_of(name) in ("time", "date")]
    # The direction of a ship is no object.
    tracks = [name for name in names if name in ("track", "episode")]
    given = dict(columns or {})
    if object_column is None and tracks:
        object_column = str(names.index(tracks[0]) + 1)
    roles = find_columns(table, given, object_column, (("mode",),))
    if "time" not in roles and "date" not in roles:
        raise ArgumentError(
            f"{table.file}: no column of times ({table.listed()}): name it by --columns, as time=1"
        )
    times = read_times(table, roles, time_unit)
    for other in clocks if "time" not in given else ():
        if (times.epoch is not None) != dated:
            with suppress(ArgumentError):
                times = read_times(table, {**roles, "time": other}, time_unit)
    samples = pd.DataFrame({"time": times.seconds, "mode": table.frame[roles["mode"]]})
    result = ModeFile({}, {})
    # What is told concerns the modes, and from here on rows that are samples.
    table.notes, table.left_out = [note for note in table.notes if "taken as mode" in note], {}
    for name, rows in object_rows(table, roles, Path(path)):
        ordered = sorted_rows(table, samples.iloc[rows])
        ordered = table.without(ordered, ordered.time.duplicated(), REPEATED)
        seconds = ordered.time.to_numpy()
        dates = None if times.epoch is None else dates_since(times.epoch, seconds)
        result.times[name] = seconds if dates is None else dates
        result.modes[name] = [
            None if pd.isna(cell) else cell_text(cell) for cell in ordered["mode"]
        ]
    if said := remarks(table):
        warnings.warn(f"{table.file}: {'; '.join(said)}", stacklevel=2)
    return result


def _read_folder(folder: Path, **options: Any) -> ModeFile:
    """Read the results in a folder."""
    paths = [path for name in ROW_FILES for path in sorted(folder.rglob(name))]
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
