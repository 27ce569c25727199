"""From a file to a table of its cells. The kind of a file is found by its content."""

import csv
import gzip
import io
import os
import re
import zlib
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gpxpy
import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv
import pyarrow.parquet

from baselines.recordings.reading.igc import is_igc, parse_igc
from baselines.recordings.reading.names import role_of
from baselines.recordings.reading.table import Table
from hybrid_env.checks import ArgumentError, reject

KINDS = "a CSV, TSV, Parquet, GPX or IGC file"


@dataclass(frozen=True)
class Limits:
    """How large a file and what it holds may be. What a file states of its size is checked before
    it is read.
    """

    # Of the file, and of what is decompressed.
    megabytes: int = 250
    # Decompressed bytes over compressed ones, above 10 MB.
    ratio: int = 50
    # `hybridtrack track` then needs a few gigabytes of memory at most.
    rows: int = 2_500_000
    columns: int = 2_000
    cells: int = 50_000_000
    # Characters of a line, and bytes of a text in a column of a Parquet file.
    line: int = 50_000
    cell: int = 1_000
    # Tags of a GPX file.
    tags: int = 10_000_000

    def check(self, file: str, **sizes: int) -> None:
        """Refuse a size of a file, named as the fields, that is too large."""
        for name, size in sizes.items():
            largest = getattr(self, name)
            if size > largest:
                raise ArgumentError(
                    f"{file}: {size:,} {name}, at most {largest:,} are allowed: split the recording"
                )


LIMITS = Limits()

MARKS = {b"\xff\xfe\0\0": "utf-32", b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16"}
"""Encodings by the first bytes of a file."""

PLT = "lat,lon,first,altitude,days,date,time"
HEADS = {
    "MSG,": (
        0,
        "message,transmission,session,aircraft,hex,flight_number,date,time,date_logged,time_logged,"
        "callsign,altitude,speed,heading,lat,lon,vertical_rate,squawk,alert,emergency,spi,ground",
    ),
    "OziExplorer": (6, PLT),
    "Geolife": (6, PLT),
}
"""Lines before the rows and names of the columns of files without names, by their first words."""


def read_table(path: str | os.PathLike[str]) -> Table:
    """Read the cells of a file.

    Raises:
        ArgumentError: it is none of the kinds of files, damaged or too large.
    """
    file, content = _content(Path(path))
    start = content[:1000].lstrip(b"\xef\xbb\xbf\xff\xfe\0 \r\n")
    if start[:4] == b"PAR1":
        return _read_parquet(content, file)
    if start[:1] == b"<":
        return _read_gpx(content, file)
    if is_igc(content):
        LIMITS.check(file, rows=content.count(b"\nB"))
        log = parse_igc(file, content)
        frame = pd.DataFrame(dict(enumerate((log.times, log.latitudes, log.longitudes))))
        names = ("time", "lat", "lon")
        return Table(file, frame, names, np.arange(1, len(frame) + 1), notes=log.notes)
    if start[:4] in (b"PK\x03\x04", b"\xd0\xcf\x11\xe0"):
        raise reject("file", file, f"{KINDS}, not a workbook or archive: export it as CSV")
    return _read_text(content, file)


def _content(path: Path) -> tuple[str, bytes]:
    """Return the name of a file for messages, and its bytes, decompressed."""
    file = str(path) if len(str(path)) <= 80 else f"...{str(path)[-80:]}"
    largest = LIMITS.megabytes * 10**6
    try:
        # A named pipe would wait for its writer.
        if not path.is_file():
            raise reject("file", file, f"an existing file: {KINDS}")
        if path.stat().st_size > largest:
            raise reject("file", file, f"at most {LIMITS.megabytes} MB: split the recording")
        content = path.read_bytes()
    except ArgumentError:
        raise
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise reject("file", file, f"a file that can be read ({reason})") from None
    if content[:2] != b"\x1f\x8b":
        return file, content
    largest = min(largest, max(LIMITS.ratio * len(content), 10**7))
    try:
        with gzip.open(io.BytesIO(content)) as stream:
            content = stream.read(largest + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise ArgumentError(f"{file}: the gzip file is damaged or cut off ({error})") from None
    if len(content) > largest:
        allowed = (
            f"at most {largest / 1e6:.0f} MB when decompressed: decompress it first, or split it"
        )
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
        LIMITS.check(file, rows=rows, columns=len(kept), cells=rows * len(kept))
        table = stored.read(columns=kept, use_threads=False)
        # The index of pandas, whose columns have no names of their own, is the first column.
        index = [name.startswith("__index_level_") for name in table.column_names]
        long = [_is_long(column) for column in table.columns]
        order = [k for k in np.argsort(np.invert(index), kind="stable").tolist() if not long[k]]
        # What pandas says about the columns may be damaged.
        frame = table.select(order).to_pandas(ignore_metadata=True)
    except (pa.ArrowException, OSError, ValueError, TypeError, OverflowError) as error:
        if isinstance(error, ArgumentError):
            raise
        raise ArgumentError(f"{file}: the Parquet file is damaged ({error})") from None
    if not rows:
        raise reject("file", file, "a file with rows, not an empty table")
    names = tuple("" if index[k] else table.column_names[k] for k in order)
    unread = [name for name, is_long in zip(table.column_names, long, strict=True) if is_long]
    notes = [f"columns of long texts, which are not read: {', '.join(unread)}"] if unread else []
    frame = frame.set_axis(range(len(names)), axis=1)
    return Table(file, frame, names, np.arange(1, rows + 1), notes=notes)


def _is_long(column: pa.ChunkedArray) -> bool:
    """Return whether texts of a column are longer than numbers, times and names, or would be larger
    together than a file may be.
    """
    if not pa.types.is_dictionary(column.type) or pa.types.is_primitive(column.type.value_type):
        return False
    lengths = pa.chunked_array(
        [
            pc.binary_length(part.dictionary).cast(pa.int64()).take(part.indices)
            for part in column.chunks
        ],
        pa.int64(),
    )
    longest, total = pc.max(lengths).as_py() or 0, pc.sum(lengths).as_py() or 0
    return longest > LIMITS.cell or total > LIMITS.megabytes * 10**6


def _read_gpx(content: bytes, file: str) -> Table:
    """Read time, latitude and longitude of the track points, with the track of each point."""
    LIMITS.check(file, rows=content.count(b"<trkpt"), tags=content.count(b"<"))
    notes: list[str] = []
    # It is text now, whatever its first line says of the bytes.
    text = re.sub(r"^\s*<\?xml[^>]*>", "", _decoded(content, file, notes))
    text = re.sub(r"&(?!#?\w+;)", "&amp;", text)
    whole, _, rest = text.rpartition("</trkpt>")
    if whole and "</gpx>" not in rest:
        text = whole + "</trkpt></trkseg></trk></gpx>"
        notes.append("the end of the file is missing")
    try:
        gpx = gpxpy.parse(text)
    except (gpxpy.gpx.GPXException, ValueError, TypeError, LookupError, RecursionError) as error:
        reason = " ".join(str(error).split())[:100]
        raise ArgumentError(f"{file}: the file begins as XML but is not GPX ({reason})") from None
    tracks: list[Any] = gpx.tracks or gpx.routes
    points = [
        (
            point.time,
            point.latitude,
            point.longitude,
            track.name or f"track {number}",
            (number, part),
        )
        for number, track in enumerate(tracks, start=1)
        for part, segment in enumerate(getattr(track, "segments", [track]))
        for point in segment.points
    ]
    frame = pd.DataFrame(points, columns=["time", "lat", "lon", "track_id", "segment"])
    if frame.empty:
        raise reject("file", file, "a GPX file with points of a track or route")
    segments = pd.factorize(frame.pop("segment"))[0]
    times = frame.pop("time").astype(object)
    if times.notna().any():
        frame.insert(0, "time", pd.to_datetime(times, utc=True))
    names = tuple(frame.columns)
    lines = np.arange(1, len(frame) + 1)
    frame = frame.set_axis(range(len(names)), axis=1)
    return Table(file, frame, names, lines, segments=segments, notes=notes)


def _read_text(content: bytes, file: str) -> Table:
    """Read the rows below the header, all cells as text."""
    LIMITS.check(file, rows=max(content.count(b"\n"), content.count(b"\r")) - 1_000)
    notes: list[str] = []
    texts = _decoded(content, file, notes).split("\n")
    LIMITS.check(file, line=max(map(len, texts)))
    if all(re.fullmatch(r'"[^"]*"', text) for text in texts if text):
        texts = [text[1:-1] for text in texts]
    rows = [(number, text) for number, text in enumerate(texts, start=1) if text.strip()]
    if not rows:
        raise reject("file", file, "rows of numbers, not an empty file")
    if re.match(r"\$G|!AIVD", rows[0][1]):
        raise reject("file", file, f"{KINDS}, not sentences of NMEA or AIS: decode them first")
    for start, (lines, columns) in HEADS.items():
        if rows[0][1].startswith(start):
            notes.append(f"columns are {columns[:60]} ...")
            rows = [(0, columns), *rows[lines:]]
    delimiter, header = _form([text for _, text in rows[:200]])
    first = 0 if header is None else header + 1
    # Units, or more names.
    while header is not None and first < len(rows) - 1 and not re.search(r"\d", rows[first][1]):
        first += 1
    title = "" if header is None else rows[header][1]
    head = [] if header is None else _cells(title.lstrip("#% "), delimiter)
    sample = [_cells(text, delimiter) for _, text in rows[first : first + 200]]
    if not sample:
        raise reject(f"{file}, line {rows[-1][0]}", rows[-1][1][:60], "rows of numbers after it")
    width = Counter(map(len, sample)).most_common(1)[0][0]
    LIMITS.check(file, columns=width, cells=width * len(rows))
    if len(head) == width - 1:
        # The name of the row, as pandas writes it, or an empty cell at the end.
        head = [*head, ""] if not any(cells[-1] for cells in sample) else ["", *head]
    if len(head) < width:
        head = re.split(r"[\s;|,]+", title.strip("#% "))
    names = tuple(head[:width]) if len(head) >= width else ("",) * width
    table = Table(file, pd.DataFrame(), names, np.empty(0, int), header is not None, notes=notes)
    table.leave_out("lines before the header", [number for number, _ in rows[: header or 0]])
    if header is not None:
        below = [number for number, _ in rows[header + 1 : first]]
        table.leave_out("lines without numbers below the header", below)
    rows = rows[first:]
    blank = set(range(rows[0][0], rows[-1][0])) - {number for number, _ in rows}
    table.leave_out("blank lines", sorted(blank))
    comments = [number for number, text in rows if text.lstrip().startswith(("#", "%", "//"))]
    repeated = [number for number, text in rows if head and text == title]
    table.leave_out("comments", comments)
    table.leave_out("repeated headers", repeated)
    others = {*comments, *repeated}
    rows = [(number, text) for number, text in rows if number not in others]
    texts = [text for _, text in rows]
    table.frame, wrong = _parsed(texts, delimiter, width, file)
    if wrong:
        numbers = table.frame.apply(pd.to_numeric, errors="coerce").notna().mean()
        needed = [role_of(name) is not None for name in names]
        for k in wrong:
            texts[k] = _aligned(texts[k], delimiter, (numbers > 0.5).tolist(), needed)
        table.frame, wrong = _parsed(texts, delimiter, width, file)
    table.leave_out("rows with another number of cells", [rows[k][0] for k in wrong])
    table.lines = np.delete(np.array([number for number, _ in rows], int), wrong)
    empty = np.asarray(table.frame.isna().all(axis=1))
    table.frame = table.frame[~empty].reset_index(drop=True)
    table.leave_out("empty rows", table.lines[empty])
    table.lines = table.lines[~empty]
    return table


def _decoded(content: bytes, file: str, notes: list[str]) -> str:
    """Return the text of UTF-8, UTF-16, UTF-32 or Windows-1252, with line ends of Unix."""
    encodings = [name for mark, name in MARKS.items() if content.startswith(mark)][:1]
    if not encodings and content[1:40:2].count(0) > 10:
        encodings = ["utf-16-le"]
    for encoding in encodings or ("utf-8-sig", "cp1252"):
        try:
            # A logger without power leaves the rest of its file empty.
            errors = "replace" if encoding == "cp1252" else "strict"
            text = content.decode(encoding, errors).rstrip("\0\x1a")
        except UnicodeDecodeError:
            continue
        if "\0" in text:
            break
        if encoding == "cp1252":
            notes.append("read as Windows-1252, as it is not UTF-8")
        return text.replace("\ufeff", "").replace("\r\n", "\n").replace("\r", "\n")
    raise reject("file", file, f"{KINDS}; it is not a text in UTF-8, UTF-16 or Windows-1252")


def _form(lines: list[str]) -> tuple[str, int | None]:
    """Return the delimiter and the index of the header, None if there is none: the line with most
    names of columns that are known, and otherwise a first line without a number.
    """
    best: tuple[Any, ...] = (0,)
    for delimiter in ("\t", ";", "|", ",", " "):
        rows = [_cells(line.lstrip("#% "), delimiter) for line in lines]
        [(usual, times)] = Counter(map(len, rows)).most_common(1)
        for number, cells in enumerate(rows):
            words = [cell for cell in cells if not re.match(r"[\d.+-]", cell)]
            known = sum(role_of(word) is not None for word in words)
            # The delimiter of the header may be another one, as of numpy.savetxt.
            fit = (known >= 2 and usual > 1, usual > 1 and times / len(rows), known, -number)
            best = max(best, (*fit, delimiter, number), key=lambda form: form[:4])
            # The names of the columns are above the first row.
            if usual > 1 and len(cells) == usual and not words and lines[number][0] not in "#%":
                break
    _, share, known, _, delimiter, number = best
    if known >= 2:
        return delimiter, number
    if not share:
        return ",", None
    return delimiter, None if re.search(r"^[+-]?[.,]?\d", lines[0].strip()) else 0


def _aligned(line: str, delimiter: str, numeric: list[bool], needed: list[bool]) -> str:
    """Return a line with as many cells as there are columns, if a text has delimiters without
    quotes, or if cells at the end are missing that are not needed, or more that are no numbers.
    Numbers must be where other lines have them. Any other line is returned as it is.
    """
    number = r"[+-]?[\d.,]*\d[\d.,]*(?:[eE][+-]?\d+)?"
    cells = _cells(line, delimiter)
    width, more = len(numeric), len(cells) - len(numeric)
    forms = []
    if more < 0 and not any(needed[more:]):
        forms.append([*cells, *[""] * -more])
    elif more > 0:
        if not any(re.fullmatch(number, cell) for cell in cells[width:]):
            forms.append(cells[:width])
        for k in range(width):
            rest = cells[k + 1 : k + more + 1]
            if not any(re.fullmatch(number, cell) for cell in rest):
                forms.append([*cells[:k], " ".join([cells[k], *rest]), *cells[k + more + 1 :]])
    for form in forms:
        pairs = zip(form, numeric, strict=True)
        if all(not of_number or re.fullmatch(rf"{number}|\W*", cell) for cell, of_number in pairs):
            return delimiter.join(f'"{cell}"' if delimiter in cell else cell for cell in form)
    return line


def _cells(line: str, delimiter: str) -> list[str]:
    """Return the cells of a line; spaces between them count as one."""
    if delimiter == " ":
        return line.split()
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter))]
    except (csv.Error, StopIteration):
        return [line]


def _parsed(
    lines: list[str], delimiter: str, width: int, file: str
) -> tuple[pd.DataFrame, list[int]]:
    """Return the cells of lines as texts, and the numbers of the lines with another number of
    cells, which are left out.
    """
    wrong: list[int] = []

    def skip(row: pyarrow.csv.InvalidRow) -> str:
        wrong.append(row.number - 1)
        return "skip"

    if delimiter == " ":
        lines = [" ".join(line.split()) for line in lines]
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
    return table.to_pandas().set_axis(range(width), axis=1), wrong
