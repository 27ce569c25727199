"""Reading a file of recorded positions: CSV, TSV, Parquet or GPX, also compressed by gzip."""

import os
from collections.abc import Mapping
from dataclasses import dataclass

from baselines.recordings.recording import Recording


@dataclass(frozen=True, eq=False)
class RecordingFile:
    """What was read of a file.

    Attributes:
        recordings: one for each object, in the order in which they appear in the file.
        summary: one line that says what was read and what was left out.
    """

    recordings: tuple[Recording, ...]
    summary: str


def read_recordings(
    path: str | os.PathLike[str],
    *,
    columns: Mapping[str, str] | None = None,
    object_column: str | None = None,
    unit: str | None = None,
    time_unit: str | None = None,
    tau: float | None = None,
    gap: float | None = None,
) -> RecordingFile:
    """Read the recordings of a file.

    Args:
        path: the file.
        columns: name or number (from 1) of the column of each of `time`, `x`, `y`, `lat`, `lon`; None finds
            them by their names.
        object_column: column that tells several objects apart; `none` for a file with one object; None finds
            it by its name.
        unit: unit of x and y; `deg` for longitude and latitude; None takes it from the header.
        time_unit: unit of the times: s, ms, us, ns, min, h, or a format such as `%d/%m/%Y %H:%M:%S`; None
            recognises ISO dates and seconds, milliseconds ... since 1970, and otherwise means seconds.
        tau: duration of a tick [s] of a file without times; None counts time in ticks.
        gap: longest time between two measurements of one piece [s]; None is 20 nominal ticks.

    Raises:
        ArgumentError: the file cannot be read, or it is not clear what its columns mean; the message names
            file, line, value and what is allowed, or the option that helps.
    """
    raise NotImplementedError
