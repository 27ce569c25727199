"""From a file to a table of its cells. The kind of a file is found by its content."""

import csv
import gzip
import io
import os
import re
import zlib
from collections import Counter
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv
import pyarrow.parquet

from baselines.recordings.reading.igc import is_igc, parse_igc
from baselines.recordings.reading.names import role_of
from baselines.recordings.reading.nested import (
    POINTS,
    rows_of_ais,
    rows_of_json,
    rows_of_nmea,
    rows_of_xml,
)
from baselines.recordings.reading.table import Table
from hybrid_env.checks import ArgumentError, reject

KINDS = "a CSV, TSV, Parquet, GPX, TCX, KML, GeoJSON, NMEA, AIS or IGC file"


LIMITS = {
    # Of the file, and of what is decompressed.
    "megabytes": 250,
    # Decompressed bytes over compressed ones, above 10 MB.
    "ratio": 50,
    # `hybridtrack track` then needs a few gigabytes of memory at most.
    "rows": 2_500_000,
    "columns": 2_000,
    "cells": 50_000_000,
    # Characters of a line, and bytes of a text in a column of a Parquet file.
    "line": 50_000,
    "cell": 1_000,
    # Of XML, and values of JSON.
    "tags": 10_000_000,
}
"""How large a file and what it holds may be. What a file states of its size is checked before it is
read.
"""


def check_sizes(file: str, **sizes: float) -> None:
    """Refuse a size of a file, named as in `LIMITS`, that is too large."""
    for name, size in sizes.items():
        if size > LIMITS[name]:
            allowed = f"at most {LIMITS[name]:,} are allowed: split the recording"
            raise ArgumentError(f"{file}: {size:,} {name}, {allowed}")


def read_table(path: str | os.PathLike[str]) -> Table:
    """Read the cells of a file.

    Raises:
        ArgumentError: it is none of the kinds of files, damaged or too large.
    """
    file, content = _content(Path(path))
    start = content[:1000].lstrip(b"\xef\xbb\xbf\xff\xfe\0 \r\n")
    if start.startswith(b"PAR1"):
        return _read_parquet(content, file)
    if start.startswith((b"<", b"{", b"[")):
        return _read_nested(content, file)
    if not is_igc(content):
        return _read_text(content, file)
    check_sizes(file, rows=content.count(b"\nB"))
    log = parse_igc(file, content)
    # A for a position in three dimensions, V for none or one in two.
    valid = [record[24:25].decode() for record in log.records]
    places = {"lat": log.latitudes, "lon": log.longitudes, "altitude_m": log.altitudes}
    frame = pd.DataFrame({"time": log.times, **places, "valid": valid})
    return Table(file, _numbered(frame), notes=[*log.notes])


def _numbered(frame: pd.DataFrame) -> pd.DataFrame:
    """Return rows with numbers from 1, for files without lines."""
    return frame.set_axis(range(1, len(frame) + 1))


def _content(path: Path) -> tuple[str, bytes]:
    """Return the name of a file for messages, and its bytes, decompressed."""
    file = str(path) if len(str(path)) <= 80 else f"...{str(path)[-80:]}"
    # A named pipe would wait for its writer.
    if not os.path.isfile(path):
        raise reject("file", file, f"an existing file: {KINDS}")
    check_sizes(file, megabytes=path.stat().st_size / 1e6)
    try:
        content = path.read_bytes()
        if content[:2] != b"\x1f\x8b":
            return file, content
        largest = min(LIMITS["megabytes"] * 10**6, max(LIMITS["ratio"] * len(content), 10**7))
        with gzip.open(io.BytesIO(content)) as stream:
            content = stream.read(largest + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise ArgumentError(f"{file}: damaged, cut off or not to be read ({error})") from None
    if len(content) > largest:
        allowed = f"at most {largest / 1e6:.0f} MB when decompressed: decompress or split it"
        raise reject("file", file, allowed)
    return file, content


def _read_parquet(content: bytes, file: str) -> Table:
    """Read the columns of numbers, texts and times."""
    try:
        schema = pyarrow.parquet.read_schema(pa.BufferReader(content))
        kept = [column.name for column in schema if not pa.types.is_nested(column.type)]
        # Texts that repeat are stored once, and may be far larger than the file.
        stored = pyarrow.parquet.ParquetFile(pa.BufferReader(content), read_dictionary=kept)
        rows = stored.metadata.num_rows
        check_sizes(file, rows=rows, columns=len(kept), cells=rows * len(kept))
        table = stored.read(columns=kept, use_threads=False)
        long = [k for k, column in enumerate(table.columns) if _is_long(column)]
        notes = [f"column of long texts, which is not read: {table.column_names[k]}" for k in long]
        table = table.select(np.delete(np.arange(len(kept)), long).tolist())
        # What pandas says about the columns may be damaged.
        frame = table.to_pandas(ignore_metadata=True)
    except ArgumentError:
        raise
    except (pa.ArrowException, OSError, ValueError, TypeError, OverflowError) as error:
        raise ArgumentError(f"{file}: the Parquet file is damaged ({error})") from None
    if not rows:
        raise reject("file", file, "a file with rows, not an empty table")
    return Table(file, _numbered(frame), notes=notes)


def _is_long(column: pa.ChunkedArray) -> bool:
    """Return whether texts of a column are longer than numbers, times and names, or might be larger
    together than a file may be.
    """
    if not pa.types.is_dictionary(column.type) or pa.types.is_primitive(column.type.value_type):
        return False
    lengths = [pc.max(pc.binary_length(part.dictionary)).as_py() for part in column.chunks]
    longest = max(length or 0 for length in lengths)
    return longest > LIMITS["cell"] or longest * len(column) > LIMITS["megabytes"] * 10**6


def _read_nested(content: bytes, file: str) -> Table:
    """Read the positions of XML or JSON."""
    notes: list[str] = []
    marks = sum(map(content.count, (b"<", b"{", b"[", b",")))
    check_sizes(file, rows=sum(content.count(f"<{tag}".encode()) for tag in POINTS), tags=marks)
    text = _decoded(content, file, notes).strip()
    frame = (rows_of_xml if text.startswith("<") else rows_of_json)(text, file)
    check_sizes(file, columns=frame.shape[1], cells=frame.size)
    segments = frame.pop("segment").to_numpy() if "segment" in frame else 0
    return Table(file, _numbered(frame), segments=segments, notes=notes)


def _read_text(content: bytes, file: str) -> Table:
    """Read the rows below the header, all cells as text."""
    check_sizes(file, rows=max(content.count(b"\n"), content.count(b"\r")) - 1_000)
    notes: list[str] = []
    texts = _decoded(content, file, notes).split("\n")
    check_sizes(file, line=max(map(len, texts)))
    # Texts of Python: a copy would need as much memory again.
    rows = pd.Series(texts, range(1, len(texts) + 1), object)
    blank = rows.str.isspace() | (rows == "")
    filled = rows[~blank]
    if filled.empty:
        raise reject("file", file, "rows of numbers, not an empty file")
    head = filled.iloc[:200]
    if head.str.contains(r"\$..(?:RMC|GGA),").any():
        cells, wrong = rows_of_nmea(filled)
        table = Table(file, cells, notes=notes)
        table.leave_out("sentences with a wrong checksum", wrong)
        return table
    if head.str.contains(r"!..VD[MO],").any():
        cells, wrong = rows_of_ais(filled, file)
        table = Table(file, cells, notes=notes)
        table.leave_out("sentences with a wrong checksum", wrong)
        return table
    # Texts that are no tables, and what makes tables of them.
    unreadable = {
        "$GP": "NMEA without sentences RMC or GGA, which have times of positions",
        "Type,Local Number,Message,": (
            "rows of fields of FitCSVTool: write a table by its options -b and --data record, and"
            " read the file that ends in _data.csv"
        ),
    }
    for word, advice in unreadable.items():
        if head.str.contains(word, regex=False).any():
            raise ArgumentError(f"{file}: {advice}")
    delimiter, header = _form(filled.iloc[:200].tolist())
    first = 0 if header is None else header + 1
    # Units, or more names.
    while 0 < first < len(filled) - 1 and not re.search(r"\d", filled.iloc[first]):
        first += 1
    title = "" if header is None else filled.iloc[header]
    sample = [_cells(text, delimiter) for text in filled.iloc[first : first + 200]]
    if not sample:
        raise reject(f"{file}, line {filled.index[-1]}", title[:60], "rows of numbers after it")
    width = Counter(map(len, sample)).most_common(1)[0][0]
    check_sizes(file, columns=width, cells=width * len(rows))
    head = _cells(title.lstrip("#% "), delimiter)
    if len(head) == width - 1:
        # The name of the row, as pandas writes it, or an empty cell at the end.
        head = ["", *head] if any(cells[-1] for cells in sample) else [*head, ""]
    if len(head) < width:
        # The delimiter of the header may be another one, as of numpy.savetxt.
        head = re.split(r"[\s;|,]+", title.strip("#% "))
    body = filled.iloc[first:]
    body = body[(body != title) & ~body.str.match(r"\s*(?:[#%]|//)")]
    frame, wrong = _parsed(body, delimiter, width, file)
    empty = frame.isna().all(axis=1)
    frame.columns = head[:width] if len(head) >= width else [""] * width
    table = Table(file, frame[~empty], header is not None, notes=notes)
    others = filled.index if header is None else filled.index.delete(header)
    table.leave_out("headers and comments", others.difference(body.index))
    inner = rows.index[blank]
    inner = inner[(inner > filled.index[first]) & (inner < filled.index[-1])]
    table.leave_out("blank lines", inner.union(frame.index[empty]))
    table.leave_out("rows with another number of cells", wrong)
    return table


def _decoded(content: bytes, file: str, notes: list[str]) -> str:
    """Return the text of UTF-8, UTF-16 or Windows-1252, with line ends of Unix."""
    marked = content[:2] in (b"\xff\xfe", b"\xfe\xff")
    try:
        text = content.decode("utf-16" if marked else "utf-8-sig")
    except UnicodeDecodeError:
        text = content.decode("cp1252", "replace")
        notes.append("read as Windows-1252, as it is not UTF-8")
    # A logger without power leaves the rest of its file empty.
    text = text.rstrip("\0\x1a")
    if "\0" in text or (notes and marked):
        allowed = f"{KINDS} in UTF-8, UTF-16 or Windows-1252: export a workbook as CSV"
        raise reject("file", file, allowed)
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _form(lines: list[str]) -> tuple[str, int | None]:
    """Return the delimiter, by which a line above the rows has names of columns that are known, and
    most lines have as many cells; and the index of the header: this line, otherwise a first line
    that does not begin with a number, None if there is none.
    """
    forms = []
    for delimiter in ("\t", ";", "|", ",", " "):
        rows = [_cells(line.lstrip("#% "), delimiter) for line in lines]
        [(width, times)] = Counter(map(len, rows)).most_common(1)
        named = None
        for number, cells in enumerate(rows if width > 1 else ()):
            words = [cell for cell in cells if cell and not re.match(r"[\d.+-]", cell)]
            if sum(role_of(word) is not None for word in words) > 1:
                named = number
                break
            filled = sum(map(bool, cells)) > width / 2
            if len(cells) == width and filled and not words and lines[number][0] not in "#%":
                break
        share = times / len(rows) * (width > 1)
        forms.append((named is not None, share, delimiter, named))
    _, share, delimiter, named = max(forms, key=lambda form: form[:2])
    if named is None and share and not re.match(r"\s*[+-]?[.,]?\d", lines[0]):
        named = 0
    return delimiter if share else ",", named


def _cells(line: str, delimiter: str) -> list[str]:
    """Return the cells of a line; spaces between them count as one."""
    if delimiter == " ":
        return line.split()
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter))]
    except (csv.Error, StopIteration):
        return [line]


def _parsed(
    rows: "pd.Series[str]", delimiter: str, width: int, file: str
) -> tuple[pd.DataFrame, pd.Index]:
    """Return the cells of rows as texts, and the lines of rows with another number of cells, which
    are left out.
    """
    wrong: list[int] = []

    def skip(row: pyarrow.csv.InvalidRow) -> str:
        wrong.append(row.number - 1)
        return "skip"

    lines = [" ".join(text.split()) for text in rows] if delimiter == " " else rows.tolist()
    names = [str(k) for k in range(width)]
    try:
        table = pyarrow.csv.read_csv(
            pa.py_buffer("\n".join(lines).encode()),
            pyarrow.csv.ReadOptions(column_names=names, use_threads=False, block_size=4_000_000),
            pyarrow.csv.ParseOptions(delimiter=delimiter, invalid_row_handler=skip),
            pyarrow.csv.ConvertOptions(
                column_types=dict.fromkeys(names, pa.string()), strings_can_be_null=True
            ),
        )
    except pa.ArrowException as error:
        raise ArgumentError(f"{file}: not CSV: {error}") from None
    if table.num_rows + len(wrong) != len(lines):
        raise ArgumentError(f"{file}: not CSV: a quoted cell goes over several lines")
    return table.to_pandas().set_axis(rows.index.delete(wrong)), rows.index[wrong]
