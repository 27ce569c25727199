"""Text files: encoding, delimiter and header of CSV and TSV, and their cells."""

import csv
import re
from collections import Counter

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.csv

from baselines.recordings.reading.names import is_known_name
from baselines.recordings.reading.table import Table, counted
from hybrid_env.checks import ArgumentError, reject

MAX_ROWS = 2_500_000
"""`hybridtrack track` then needs a few gigabytes of memory at most."""

MAX_LINE = 50_000  # characters
MAX_COLUMNS = 2_000
HEAD_ROWS = 50
"""The delimiter is found from so many rows."""

MISSING = ["", "nan", "NaN", "NAN", "NA", "N/A", "n/a", "#N/A", "null", "NULL", "None", "<NA>", "-nan"]
DELIMITERS = ("\t", ";", "|", ",", " ")
WORDS = {"\t": "tab", " ": "space"}


def read_text(content: bytes, name: str) -> Table:
    """Read the cells of a text file.

    Raises:
        ArgumentError: it is empty or no text, or its rows have different numbers of cells.
    """
    notes: list[str] = []
    text = _decoded(content, name, notes)
    lines, first = _lines(text, name, notes)
    delimiter = _delimiter(lines[: HEAD_ROWS + 1])
    if delimiter == " ":
        lines = [" ".join(line.split()) for line in lines]
    rows = [_cells(line, delimiter) for line in lines[: HEAD_ROWS + 1]]
    header = _is_header(rows[0])
    if header and len(rows) == 1:
        raise reject(f"{name}, line {first}: header", lines[0], "rows of numbers after it")
    names = _names(rows, header, lines[0])
    if len(names) > MAX_COLUMNS:
        raise ArgumentError(f"{name}: {len(names):,} columns: at most {MAX_COLUMNS:,} are allowed")
    frame = _parsed(lines[header:], delimiter, len(names), name, first + header)
    return Table(name, frame, names, header, "line", first + header, notes=notes)


def _decoded(content: bytes, name: str, notes: list[str]) -> str:
    for mark, encoding in ((b"\xff\xfe", "utf-16"), (b"\xfe\xff", "utf-16")):
        if content.startswith(mark):
            try:
                return content.decode(encoding).replace("\r\n", "\n").replace("\r", "\n")
            except UnicodeDecodeError:
                raise ArgumentError(f"{name}: not a text file: the UTF-16 text is damaged") from None
    content = content.removeprefix(b"\xef\xbb\xbf").replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    values = np.frombuffer(content, np.uint8)
    control = np.flatnonzero((values < 32) & (values != 9) & (values != 10) & (values != 12))
    if control.size:
        at = int(control[0])
        line = content.count(b"\n", 0, at) + 1
        raise ArgumentError(
            f"{name}, line {line}: byte {content[at]:#04x} is not allowed: expected a text file (CSV or TSV)"
        )
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError as error:
        text = content.decode("cp1252", errors="replace")
        if "\ufffd" in text:
            line = content.count(b"\n", 0, error.start) + 1
            raise ArgumentError(
                f"{name}, line {line}: byte {content[error.start]:#04x} is not allowed: expected UTF-8"
            ) from None
        notes.append("read as Windows-1252, as it is not UTF-8")
        return text


def _lines(text: str, name: str, notes: list[str]) -> tuple[list[str], int]:
    """Return the lines from the header on, and the number of the first one."""
    lines = text.split("\n")
    longest = max(map(len, lines))
    if longest > MAX_LINE:
        line = next(number for number, one in enumerate(lines, start=1) if len(one) > MAX_LINE)
        raise ArgumentError(f"{name}, line {line}: a line of more than {MAX_LINE:,} characters")
    empty = 0
    while lines and not lines[-1].strip(' \t,;|"'):
        empty += bool(lines.pop().strip())
    if empty:
        notes.append(f"{counted(empty, 'empty row')} at the end left out")
    first = 0
    while first < len(lines) and (not lines[first].strip() or _is_comment(lines, first)):
        first += 1
    if first == len(lines):
        raise reject("file", name, "rows of numbers, not an empty file")
    if first:
        notes.append(f"{counted(first, 'line')} before the header left out")
    lines = lines[first:]
    lines[0] = lines[0].lstrip().removeprefix("#").strip() if lines[0].lstrip().startswith("#") else lines[0]
    if len(lines) > MAX_ROWS + 1:
        raise ArgumentError(f"{name}: more than {MAX_ROWS:,} rows are not allowed: split the recording")
    blank = next((number for number, line in enumerate(lines) if not line or line.isspace()), None)
    if blank is not None:
        raise ArgumentError(f"{name}, line {first + blank + 1}: a blank line is not allowed: remove it")
    return lines, first + 1


def _is_comment(lines: list[str], number: int) -> bool:
    """Whether a line is a comment. The last one before the rows is the header, as numpy.savetxt writes it."""
    line = lines[number].strip()
    if re.fullmatch(r"sep=.", line):
        return True
    following = lines[number + 1].lstrip() if number + 1 < len(lines) else ""
    if not line.startswith("#"):
        return False
    known = any(is_known_name(cell) for cell in re.split(r"[\t;|, ]+", line.lstrip("# ")))
    return following.startswith("#") or not known


def _delimiter(lines: list[str]) -> str:
    """Return the delimiter by which the header has known names and all rows have equally many cells."""
    best, found = (-1, 0.0, False), ","
    for delimiter in DELIMITERS:
        rows = [_cells(line, delimiter) for line in lines]
        counts = list(map(len, rows[1:] or rows))
        usual, times = Counter(counts).most_common(1)[0]
        known = sum(map(is_known_name, rows[0]))
        rank = (known, times / len(counts), abs(usual - len(rows[0])) <= 1)
        if usual > 1 and rank > best:
            best, found = rank, delimiter
    return found


def _cells(line: str, delimiter: str) -> list[str]:
    if delimiter == " ":
        return line.split()
    if '"' not in line:
        return [cell.strip() for cell in line.split(delimiter)]
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter))]
    except (csv.Error, StopIteration):
        return [line]


def _is_header(cells: list[str]) -> bool:
    return any(map(is_known_name, cells)) or not any(re.search(r"^[+-]?[.,]?\d", cell) for cell in cells)


def _names(rows: list[list[str]], header: bool, line: str) -> tuple[str, ...]:
    """Return the names of the columns.

    Rows may have one more cell than the header: the name of the row, or an empty one at the end. The header
    may have another delimiter, as of numpy.savetxt.
    """
    usual = Counter(map(len, rows[1:] or rows)).most_common(1)[0][0]
    if not header:
        return ("",) * len(rows[0])
    names = rows[0]
    if usual == len(names) + 1:
        return (*names, "") if all(not row[-1] for row in rows[1:]) else ("", *names)
    if usual > len(names):
        names = re.split(r"[\s;|,]+", line)
        return tuple(names) if len(names) == usual else ("",) * usual
    return tuple(names)


def _parsed(lines: list[str], delimiter: str, columns: int, name: str, first: int) -> pd.DataFrame:
    content = "\n".join(lines).encode()
    try:
        table = pyarrow.csv.read_csv(
            pa.py_buffer(content),
            pyarrow.csv.ReadOptions(
                column_names=[str(k) for k in range(columns)], use_threads=False, block_size=4_000_000
            ),
            pyarrow.csv.ParseOptions(delimiter=delimiter),
            pyarrow.csv.ConvertOptions(
                null_values=MISSING, strings_can_be_null=True, quoted_strings_can_be_null=True
            ),
        )
    except pa.ArrowException as error:
        found = re.search(r"Row #(\d+): Expected (\d+) columns, got (\d+): (.*)", str(error))
        if found is None:
            raise ArgumentError(f"{name}: not CSV: {str(error).removeprefix('CSV parse error: ')}") from None
        row, expected, cells, text = found.groups()
        word = WORDS.get(delimiter, f"'{delimiter}'")
        raise reject(
            f"{name}, line {int(row) + first - 1}: row",
            text[:60],
            f"{expected} cells between {word}, not {cells}",
        ) from None
    if table.num_rows != len(lines):
        raise ArgumentError(f"{name}: not CSV: a quoted cell goes over several lines")
    frame = table.to_pandas()
    frame.columns = range(columns)
    return frame
