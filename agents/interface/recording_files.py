"""Recordings of positions as CSV files: reading and writing.

A recording has the columns `x` and `y` [m] and optionally `t` [s]. A header names them in any order; without
a header the columns are `x,y` or `t,x,y`.
"""

import csv
import os
from array import array
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from io import TextIOWrapper
from itertools import chain, count
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from agents.interface.output_files import atomic_file
from hybrid_env.checks import ArgumentError, reject

Column: TypeAlias = Sequence[Any] | NDArray[Any]

MAX_VALUE = 1e12
"""Largest absolute value of a coordinate [m] or time [s]; its powers do not overflow."""

STEP_TOLERANCE = 1e-3
"""Largest relative deviation of a step of `t` from the median step."""

MAX_ROWS = 2_500_000
"""`hybridtrack track` then needs less than a gigabyte of memory."""

MAX_BYTES = 250_000_000  # of a file
MAX_LINE = 10_000  # characters
MAX_NAME = 80  # characters of the path in a message
PROGRESS_ROWS = 20_000
WRITTEN_ROWS = 50_000

HEADER = "a header with x and y once each and t at most once, separated by commas or semicolons"


@dataclass(frozen=True)
class Recording:
    """Measured positions at uniform ticks.

    Attributes:
        measurements: (T, 2) x and y [m].
        tau: mean step of the `t` column [s]; None without this column or with a single row.
        times: (T,) the `t` column [s]; None without this column.
    """

    measurements: NDArray[np.float64]
    tau: float | None = None
    times: NDArray[np.float64] | None = None


def read_recording(
    path: str | os.PathLike[str], on_progress: Callable[[float], None] | None = None
) -> Recording:
    """Read a recording.

    The encoding is UTF-8, the separator a comma or a semicolon, the decimal separator a point. Header names
    are case-insensitive. Further columns and blank lines at the end are ignored. A row is one line.

    Args:
        path: path of the CSV file.
        on_progress: called now and then with the fraction of the file that has been read.

    Raises:
        ArgumentError: the file is invalid; the message states file, line, value and what is allowed.
    """
    path = Path(path)
    _check_file(path)
    try:
        # undecodable bytes become surrogates, which `_rows` refuses with their line
        with path.open(encoding="utf-8-sig", errors="surrogateescape") as stream:
            name = str(path)
            return _read(name if len(name) <= MAX_NAME else f"...{name[-MAX_NAME:]}", stream, on_progress)
    except OSError as error:
        raise reject("file", str(path), f"a file that can be read ({error.strerror})") from None


def _read(name: str, stream: TextIOWrapper, on_progress: Callable[[float], None] | None) -> Recording:
    rows = _rows(name, stream)
    _, first = next(rows)
    names = [cell.strip().lower() for cell in first]
    names[0] = names[0].lstrip("#").lstrip()  # as numpy.savetxt writes headers
    values = array("d")
    if {"x", "y"} <= set(names) or not any(map(_is_number, first)):
        columns = _header_columns(f"{name}, line 1: header", names, first)
        first_line = 2
    elif len(first) in (2, 3):
        columns = dict(zip(("t", "x", "y")[-len(first) :], range(3), strict=False))
        first_line = 1
        rows = chain([(1, first)], rows)
    else:
        raise reject(f"{name}, line 1: row", ",".join(first), f"the cells x,y or t,x,y, or {HEADER}")
    size = os.fstat(stream.fileno()).st_size
    for line, cells in rows:
        if len(cells) != len(first):
            raise reject(
                f"{name}, line {line}: row",
                ",".join(cells),
                f"{len(first)} cells as in line 1, not {len(cells)}",
            )
        try:
            values.extend([_number(cells[column]) for column in columns.values()])
        except ValueError:
            raise _refused_cell(f"{name}, line {line}", columns, cells) from None
        if line - first_line >= MAX_ROWS:
            raise ArgumentError(
                f"{name}, line {line}: more than {MAX_ROWS:,} rows are not allowed: split the recording"
            )
        if on_progress is not None and line % PROGRESS_ROWS == 0:
            on_progress(os.lseek(stream.fileno(), 0, os.SEEK_CUR) / size)
    if not values:
        raise reject(f"{name}, line 1: header", ",".join(first), "rows of numbers after it")
    table = np.frombuffer(values).reshape(-1, len(columns))
    found = dict(zip(columns, table.T, strict=True))
    measurements = np.stack([found["x"], found["y"]], axis=1)
    if "t" not in found:
        return Recording(measurements)
    times = found["t"].copy()
    return Recording(measurements, _tick(name, first_line, times), times)


def write_table(path: str | os.PathLike[str], columns: Mapping[str, Column]) -> None:
    """Write columns as CSV with a header. The file is written completely or not at all.

    Args:
        path: path of the file; an existing file is replaced.
        columns: one-dimensional sequences of equal length, by name. Floats are written without loss of
            precision.

    Raises:
        ArgumentError: the columns have different lengths, or the file cannot be written.
    """
    lengths = {name: len(column) for name, column in columns.items()}
    if len(set(lengths.values())) > 1:
        raise reject("columns", lengths, "columns of equal length")
    with atomic_file(Path(path)) as part, part.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(columns)
        for first in range(0, max(lengths.values(), default=0), WRITTEN_ROWS):  # bounds the memory
            parts = [column[first : first + WRITTEN_ROWS] for column in columns.values()]
            lists = [one.tolist() if isinstance(one, np.ndarray) else one for one in parts]
            writer.writerows(zip(*lists, strict=True))


def _check_file(path: Path) -> None:
    try:
        if path.is_dir():
            raise reject("file", str(path), "a CSV file, not a folder")
        if not path.is_file():  # for example a named pipe, which would wait for its writer
            raise reject("file", str(path), "an existing CSV file")
        size = path.stat().st_size
    except OSError as error:
        raise reject("file", str(path), f"a file that can be read ({error.strerror})") from None
    if size > MAX_BYTES:
        allowed = f"a file of at most {MAX_BYTES / 1e6:.0f} MB, not {size / 1e6:.0f} MB: split the recording"
        raise reject("file", str(path), allowed)


def _rows(name: str, stream: TextIOWrapper) -> Iterator[tuple[int, list[str]]]:
    """Yield line number and cells of each row, without blank lines at the end; at least one row."""
    separator, blank = "", 0
    for number in count(1):
        line = stream.readline(MAX_LINE + 1)
        if not line:
            break
        if len(line) > MAX_LINE:
            raise ArgumentError(f"{name}, line {number}: a line of more than {MAX_LINE:,} characters")
        if not line.isascii() or "\0" in line:
            _check_characters(f"{name}, line {number}", line)
        text = line.rstrip("\n")
        if not text.strip(" \t,;"):
            blank = blank or number
            continue
        if blank:
            raise ArgumentError(
                f"{name}, line {blank}: a blank line is not allowed: expected one row per line"
            )
        separator = separator or (";" if ";" in text else ",")
        if '"' not in text:
            yield number, text.split(separator)
            continue
        try:
            yield number, next(csv.reader([text], delimiter=separator, strict=True))
        except csv.Error as error:
            raise ArgumentError(f"{name}, line {number}: not CSV: {error}") from None
    if not separator:
        raise reject("file", name, "a CSV file with rows of numbers, not an empty file")


def _check_characters(place: str, line: str) -> None:
    for character in line:
        if character == "\0" or "\ud800" <= character <= "\udfff":
            byte = ord(character) & 0xFF
            raise ArgumentError(f"{place}: byte {byte:#04x} is not allowed: expected a CSV file in UTF-8")


def _header_columns(place: str, names: list[str], cells: list[str]) -> dict[str, int]:
    wanted = [name for name in ("t", "x", "y") if name in names]
    if not {"x", "y"} <= set(wanted) or any(names.count(name) > 1 for name in wanted):
        raise reject(place, ",".join(cells), HEADER)
    return {name: names.index(name) for name in wanted}


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _number(cell: str) -> float:
    value = float(cell)
    if not abs(value) <= MAX_VALUE or "_" in cell:
        raise ValueError
    return value


def _refused_cell(place: str, columns: Mapping[str, int], cells: list[str]) -> ArgumentError:
    """Return the error for the first cell of a row that is not a number."""
    for name, column in columns.items():
        try:
            _number(cells[column])
        except ValueError:
            unit = "[s]" if name == "t" else "[m]"
            allowed = f"a finite number {unit} with a decimal point, of magnitude at most {MAX_VALUE:g}"
            return reject(f"{place}: {name}", cells[column], allowed)
    raise AssertionError


def _tick(name: str, first_line: int, times: NDArray[np.float64]) -> float | None:
    """Mean step [s] of the times in consecutive lines.

    Raises:
        ArgumentError: the times do not increase, or not uniformly.
    """
    steps = np.diff(times)
    if not steps.size:
        return None
    decreasing = np.flatnonzero(steps <= 0.0)
    if decreasing.size:
        k = int(decreasing[0]) + 1
        raise reject(
            f"{name}, line {first_line + k}: t", float(times[k]), f"a time after {times[k - 1]:.12g} s"
        )
    median = float(np.median(steps))
    uneven = np.flatnonzero(np.abs(steps - median) > STEP_TOLERANCE * median)
    if uneven.size:
        k = int(uneven[0]) + 1
        raise reject(
            f"{name}, line {first_line + k}: t",
            float(times[k]),
            f"{times[k - 1] + median:.12g}, as steps must be {median:.6g} s within {STEP_TOLERANCE:.1%}: "
            "resample the recording to uniform ticks",
        )
    return float(steps.mean())
