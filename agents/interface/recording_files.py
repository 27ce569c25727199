"""Recordings of positions as CSV files: reading and writing.

A recording has the columns `x` and `y` [m] and optionally `t` [s]. A header names them in any order; without
a header the columns are `x,y` or `t,x,y`.
"""

import csv
import io
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
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


def read_recording(path: str | os.PathLike[str]) -> Recording:
    """Read a recording.

    The encoding is UTF-8, the separator a comma or a semicolon, the decimal separator a point. Header names
    are case-insensitive. Further columns and blank lines at the end are ignored.

    Args:
        path: path of the CSV file.

    Raises:
        ArgumentError: the file is invalid; the message states file, line, value and what is allowed.
    """
    path = Path(path)
    rows = _rows(path, _text(path))
    first_line, first = rows[0]
    names = [cell.strip().lower() for cell in first]
    names[0] = names[0].lstrip("#").lstrip()  # as numpy.savetxt writes headers
    if {"x", "y"} <= set(names) or not any(map(_is_number, first)):
        columns = _header_columns(f"{path}, line {first_line}: header", names, first)
        rows = rows[1:]
    elif len(first) in (2, 3):
        columns = dict(zip(("t", "x", "y")[-len(first) :], range(3), strict=False))
    else:
        raise reject(
            f"{path}, line {first_line}: row", ",".join(first), f"the cells x,y or t,x,y, or {HEADER}"
        )
    if not rows:
        raise reject(f"{path}, line {first_line}: header", ",".join(first), "rows of numbers after it")

    values = np.empty((len(rows), len(columns)))
    for k, (line, cells) in enumerate(rows):
        if len(cells) != len(first):
            shown = ",".join(cells)
            raise reject(
                f"{path}, line {line}: row",
                shown,
                f"{len(first)} cells as in line {first_line}, not {len(cells)}",
            )
        for j, (name, column) in enumerate(columns.items()):
            values[k, j] = _number(f"{path}, line {line}: {name}", cells[column])
    found = dict(zip(columns, values.T, strict=True))
    measurements = np.stack([found["x"], found["y"]], axis=1)
    if "t" not in found:
        return Recording(measurements)
    times = found["t"].copy()
    return Recording(measurements, _tick(path, [line for line, _ in rows], times), times)


def write_table(path: str | os.PathLike[str], columns: Mapping[str, Column]) -> None:
    """Write columns as CSV with a header. The file is written completely or not at all.

    Args:
        path: path of the file; an existing file is replaced.
        columns: one-dimensional sequences of equal length, by name. Floats are written without loss of
            precision.

    Raises:
        ArgumentError: the columns have different lengths, or the file cannot be written.
    """
    lists: dict[str, list[Any]] = {}
    for name, column in columns.items():
        lists[name] = column.tolist() if isinstance(column, np.ndarray) else list(column)
    if len({len(column) for column in lists.values()}) > 1:
        raise reject(
            "columns", {name: len(column) for name, column in lists.items()}, "columns of equal length"
        )
    with atomic_file(Path(path)) as part, part.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(lists)
        writer.writerows(zip(*lists.values(), strict=True))


def _text(path: Path) -> str:
    if path.is_dir():
        raise reject("file", str(path), "a CSV file, not a folder")
    if not path.is_file():
        raise reject("file", str(path), "an existing CSV file")
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ArgumentError(f"{path} cannot be read: {error.strerror or error}") from None
    try:
        text = content.decode("utf-8-sig")
        bad = text.find("\0")
        if bad < 0:
            return text
        byte, line = 0, text.count("\n", 0, bad) + 1
    except UnicodeDecodeError as error:
        byte, line = content[error.start], content.count(b"\n", 0, error.start) + 1
    raise ArgumentError(f"{path}, line {line}: byte {byte:#04x} is not allowed: expected a CSV file in UTF-8")


def _rows(path: Path, text: str) -> list[tuple[int, list[str]]]:
    """Line number and cells of each row, without blank lines at the end."""
    separator = ";" if ";" in text.strip().partition("\n")[0] else ","
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=separator, strict=True)
    try:
        rows = [(reader.line_num, cells) for cells in reader]
    except csv.Error as error:
        raise ArgumentError(f"{path}, line {reader.line_num}: not CSV: {error}") from None
    while rows and not any(cell.strip() for cell in rows[-1][1]):
        rows.pop()
    if not rows:
        raise reject("file", str(path), "a CSV file with rows of numbers, not an empty file")
    for line, cells in rows:
        if not cells:
            raise ArgumentError(
                f"{path}, line {line}: a blank line is not allowed: expected one row per line"
            )
    return rows


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


def _number(place: str, cell: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = np.nan
    if not abs(value) <= MAX_VALUE or "_" in cell:
        unit = "[s]" if place.endswith("t") else "[m]"
        raise reject(
            place, cell, f"a finite number {unit} with a decimal point, of magnitude at most {MAX_VALUE:g}"
        )
    return value


def _tick(path: Path, lines: list[int], times: NDArray[np.float64]) -> float | None:
    """Mean step [s] of the times.

    Raises:
        ArgumentError: the times do not increase, or not uniformly.
    """
    steps = np.diff(times)
    if not steps.size:
        return None
    decreasing = np.flatnonzero(steps <= 0.0)
    if decreasing.size:
        k = int(decreasing[0]) + 1
        raise reject(f"{path}, line {lines[k]}: t", float(times[k]), f"a time after {times[k - 1]:.12g} s")
    median = float(np.median(steps))
    uneven = np.flatnonzero(np.abs(steps - median) > STEP_TOLERANCE * median)
    if uneven.size:
        k = int(uneven[0]) + 1
        raise reject(
            f"{path}, line {lines[k]}: t",
            float(times[k]),
            f"{times[k - 1] + median:.12g}, as steps must be {median:.6g} s within {STEP_TOLERANCE:.1%}: "
            "resample the recording to uniform ticks",
        )
    return float(steps.mean())
