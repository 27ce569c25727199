"""From a file to its table. The kind of a file is found by its content, whatever its name is."""

import codecs
import csv
import gzip
import io
import os
import re
import zlib
from collections import Counter
from pathlib import Path

import gpxpy
import gpxpy.gpxfield
import pandas as pd
import pyarrow as pa
import pyarrow.csv

from baselines.recordings.reading import sizes
from baselines.recordings.reading.cells import MISSING, Table, counted
from baselines.recordings.reading.igc import IgcLog, is_igc, parse_igc
from baselines.recordings.reading.names import role_of
from baselines.recordings.reading.parquet import read_parquet
from baselines.recordings.reading.sizes import check_size
from hybrid_env.checks import ArgumentError, reject

# Characters.
MAX_LINE = 50_000
# Lines before the header.
MAX_COMMENTS = 10_000
# Number of rows from which the delimiter is found.
HEAD_ROWS = 50
ALLOWED = "a CSV, TSV, Parquet, GPX or IGC file"
# Delimiters and their names in messages.
DELIMITERS = {
    "\t": "tab",
    ";": "';'",
    "|": "'|'",
    ",": "','",
    " ": "space",
}


def read_table(path: str | os.PathLike[str]) -> Table:
    """Read the cells of a file. Raises `ArgumentError` if it is none of the kinds of files."""
    name, content = _content(Path(path))
    start = content[:1000].removeprefix(b"\xef\xbb\xbf").lstrip()
    if start[:4] == b"PAR1":
        return read_parquet(content, name)
    if start[:1] == b"<":
        return _read_gpx(content, name)
    log = _log(name, content)
    if log is not None:
        frame = pd.DataFrame(dict(enumerate((log.times, log.latitudes, log.longitudes))))
        return Table(name, frame, ("time", "lat", "lon"), row_word="position", notes=log.notes)
    if start[:4] in (b"PK\x03\x04", b"\xd0\xcf\x11\xe0"):
        raise reject("file", name, f"{ALLOWED}, not a workbook or archive: export it as CSV")
    return _read_text(content, name)


def _log(name: str, content: bytes) -> IgcLog | None:
    """Return the log if the content of a file is one."""
    if not is_igc(content):
        return None
    check_size(content.count(b"\nB"), name)
    return parse_igc(name, content)


def _content(path: Path) -> tuple[str, bytes]:
    """Return the name of a file for messages, and its bytes, decompressed."""
    # Characters of the path in a message.
    longest_name = 80
    name = str(path) if len(str(path)) <= longest_name else f"...{str(path)[-longest_name:]}"
    try:
        if path.is_dir():
            raise reject("file", name, f"{ALLOWED}, not a folder")
        # For example a named pipe, which would wait for its writer.
        if not path.is_file():
            raise reject("file", name, f"an existing file: {ALLOWED}")
        size = path.stat().st_size / 1e6
        most = sizes.MAX_BYTES / 1e6
        if size > most:
            allowed = f"a file of at most {most:.0f} MB, not {size:.0f} MB: split the recording"
            raise reject("file", name, allowed)
        content = path.read_bytes()
    except ArgumentError:
        raise
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise reject("file", name, f"a file that can be read ({reason})") from None
    if content[:2] != b"\x1f\x8b":
        return name, content
    try:
        with gzip.open(io.BytesIO(content)) as stream:
            most_bytes = min(
                sizes.MAX_BYTES,
                max(sizes.MAX_RATIO * len(content), sizes.ALWAYS_BYTES),
            )
            content = stream.read(most_bytes + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise ArgumentError(f"{name}: the gzip file is damaged or cut off ({error})") from None
    if len(content) > most_bytes:
        allowed = (
            f"at most {most_bytes / 1e6:.0f} MB when decompressed: decompress it first, or split"
            " the recording"
        )
        raise reject("file", name, allowed)
    return name, content


def _read_gpx(content: bytes, name: str) -> Table:
    """Read the track points of a GPX file: time, lat, lon, and the track and the segment of each
    point.
    """
    check_size(content.count(b"<trkpt"), name)
    if content.count(b"<") > sizes.MAX_TAGS:
        raise ArgumentError(
            f"{name}: more than {sizes.MAX_TAGS:,} tags are not allowed: split the recording"
        )
    try:
        tracks = gpxpy.parse(content.decode("utf-8-sig")).tracks
    except (gpxpy.gpx.GPXException, ValueError, TypeError, LookupError, RecursionError) as error:
        reason = " ".join(str(error).split())[:100]
        raise ArgumentError(f"{name}: the file begins as XML but is not GPX ({reason})") from None
    points = [
        (
            point.time,
            point.latitude,
            point.longitude,
            track.name or f"track {number}",
            (number, part),
        )
        for number, track in enumerate(tracks, start=1)
        for part, segment in enumerate(track.segments)
        for point in segment.points
    ]
    frame = pd.DataFrame(points, columns=["time", "lat", "lon", "track_id", "segment"])
    if frame.empty:
        raise reject("file", name, "a GPX file with track points (trkpt)")
    segments = pd.factorize(frame.pop("segment"))[0]
    times = frame.pop("time").astype(object)
    if times.isna().any():
        _check_gpx_times(content, name)
    if times.notna().any():
        frame.insert(0, "time", pd.to_datetime(times, utc=True))
    names = tuple(frame.columns)
    return Table(
        name,
        frame.set_axis(range(len(names)), axis=1),
        names,
        row_word="point",
        segments=segments,
    )


def _check_gpx_times(content: bytes, name: str) -> None:
    """Refuse a time of a track that gpxpy does not read; it takes such points for ones without a
    time.
    """
    for cell in re.findall(rb"<(?:\w+:)?time\b[^<>]*>([^<]*)<", content[content.find(b"<trk") :]):
        text = cell.decode("utf-8", errors="replace").strip()
        try:
            gpxpy.gpxfield.parse_time(text)
        except (gpxpy.gpx.GPXException, ValueError):
            raise reject(
                f"{name}: time",
                text,
                "an ISO date and time such as 2024-05-01T10:00:00Z",
            ) from None


def _read_text(content: bytes, name: str) -> Table:
    notes: list[str] = []
    # Before they are split, with their ends of Unix or of an old Mac.
    if max(content.count(b"\n"), content.count(b"\r")) > sizes.MAX_ROWS + MAX_COMMENTS:
        raise ArgumentError(
            f"{name}: more than {sizes.MAX_ROWS:,} rows are not allowed: split the recording"
        )
    lines, first = _lines(_decoded(content, name, notes), name, notes)
    delimiter = max(DELIMITERS, key=lambda one: _fit(lines[: HEAD_ROWS + 1], one))
    if delimiter == " ":
        lines = [" ".join(line.split()) for line in lines]
    rows = [_cells(line, delimiter) for line in lines[: HEAD_ROWS + 1]]
    known = any(map(role_of, rows[0]))
    header = known or not any(re.search(r"^[+-]?[.,]?\d", cell) for cell in rows[0])
    if header and len(rows) == 1:
        raise reject(f"{name}, line {first}: header", lines[0], "rows of numbers after it")
    names = _names(rows, lines[0]) if header else ("",) * len(rows[0])
    check_size(len(lines) - header, name, len(names))
    first += header
    frame = _parsed(lines[header:], delimiter, len(names), name, first)
    return Table(name, frame, names, header, "line", first, notes=notes)


def _decoded(content: bytes, name: str, notes: list[str]) -> str:
    """Return the text of UTF-8, UTF-16 or Windows-1252, with line ends of Unix."""
    if content[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE):
        try:
            return content.decode("utf-16").replace("\r\n", "\n").replace("\r", "\n")
        except UnicodeDecodeError:
            raise ArgumentError(f"{name}: not a text file: the UTF-16 text is damaged") from None
    content = content.removeprefix(codecs.BOM_UTF8).replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    # Bytes that a text may have.
    control = content.translate(None, bytes({9, 10, 12, 13, *range(32, 256)}))
    allowed = "a text file (CSV or TSV)"
    at = 0
    try:
        if not control:
            return content.decode("utf-8")
        at = content.index(control[:1])
    except UnicodeDecodeError as error:
        text = content.decode("cp1252", errors="replace")
        if "\ufffd" not in text:
            notes.append("read as Windows-1252, as it is not UTF-8")
            return text
        allowed = "UTF-8"
        at = error.start
    line = content.count(b"\n", 0, at) + 1
    raise ArgumentError(
        f"{name}, line {line}: byte {content[at]:#04x} is not allowed: expected {allowed}"
    )


def _lines(text: str, name: str, notes: list[str]) -> tuple[list[str], int]:
    """Return the lines from the header on, and the number of the first one."""
    lines = text.split("\n")
    if max(map(len, lines)) > MAX_LINE:
        long = next(number for number, line in enumerate(lines, start=1) if len(line) > MAX_LINE)
        raise ArgumentError(f"{name}, line {long}: a line of more than {MAX_LINE:,} characters")
    empty = 0
    while lines and not lines[-1].strip(' \t,;|"'):
        empty += bool(lines.pop().strip())
    if empty:
        notes.append(f"{counted(empty, 'empty row')} at the end left out")
    first = 0
    while first < min(len(lines), MAX_COMMENTS) and (
        not lines[first].strip() or _is_comment(lines[first : first + 2])
    ):
        first += 1
    if first == MAX_COMMENTS:
        raise ArgumentError(
            f"{name}: more than {MAX_COMMENTS:,} lines before the header: expected rows of numbers"
        )
    if first == len(lines):
        raise reject("file", name, "rows of numbers, not an empty file")
    if first:
        notes.append(f"{counted(first, 'line')} before the header left out")
    lines = lines[first:]
    if lines[0].lstrip().startswith("#"):
        lines[0] = lines[0].lstrip().removeprefix("#").strip()
    if len(lines) > sizes.MAX_ROWS + 1:
        raise ArgumentError(
            f"{name}: more than {sizes.MAX_ROWS:,} rows are not allowed: split the recording"
        )
    blank = next((number for number, line in enumerate(lines) if not line or line.isspace()), None)
    if blank is not None:
        raise ArgumentError(
            f"{name}, line {first + blank + 1}: a blank line is not allowed: remove it"
        )
    return lines, first + 1


def _is_comment(lines: list[str]) -> bool:
    """Whether the first of two lines is a comment; the last before the rows may be the header of
    numpy.savetxt.
    """
    line = lines[0].strip()
    if not line.startswith("#"):
        return re.fullmatch(r"sep=.", line) is not None
    known = any(map(role_of, re.split(r"[\t;|, ]+", line.lstrip("# "))))
    return not known or (len(lines) > 1 and lines[1].lstrip().startswith("#"))


def _fit(lines: list[str], delimiter: str) -> tuple[float, ...]:
    """Return how well a delimiter fits: known names in the header, share of rows with equally many
    cells, and whether the header has as many. Where none fits, it is the comma.
    """
    header, *rows = (_cells(line, delimiter) for line in lines)
    [(usual, times)] = Counter(map(len, rows or [header])).most_common(1)
    if usual < 2:
        return -1, delimiter == ","
    return (
        sum(role_of(cell) is not None for cell in header),
        times / max(len(rows), 1),
        abs(usual - len(header)) <= 1,
    )


def _cells(line: str, delimiter: str) -> list[str]:
    if delimiter == " ":
        return line.split()
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter))]
    except (csv.Error, StopIteration):
        return [line]


def _names(rows: list[list[str]], line: str) -> tuple[str, ...]:
    """Return the names of the columns. Rows may have one more cell than the header: the name of the
    row, or an empty one at the end. The header may have another delimiter, as of numpy.savetxt.
    """
    names = rows[0]
    [(usual, _)] = Counter(map(len, rows[1:])).most_common(1)
    if usual == len(names) + 1:
        return (*names, "") if all(not row[-1] for row in rows[1:]) else ("", *names)
    if usual > len(names):
        names = re.split(r"[\s;|,]+", line)
        return tuple(names) if len(names) == usual else ("",) * usual
    return tuple(names)


def _parsed(lines: list[str], delimiter: str, columns: int, name: str, first: int) -> pd.DataFrame:
    """Parse rows with a number of columns; `first` is the number of the first line."""
    wrong: list[pyarrow.csv.InvalidRow] = []
    names = [str(k) for k in range(columns)]

    def refuse(row: pyarrow.csv.InvalidRow) -> str:
        wrong.append(row)
        return "error"

    try:
        table = pyarrow.csv.read_csv(
            pa.py_buffer("\n".join(lines).encode()),
            pyarrow.csv.ReadOptions(column_names=names, use_threads=False, block_size=4_000_000),
            pyarrow.csv.ParseOptions(delimiter=delimiter, invalid_row_handler=refuse),
            pyarrow.csv.ConvertOptions(
                null_values=MISSING,
                strings_can_be_null=True,
                quoted_strings_can_be_null=True,
            ),
        )
    except pa.ArrowException as error:
        if not wrong:
            raise ArgumentError(
                f"{name}: not CSV: {str(error).removeprefix('CSV parse error: ')}"
            ) from None
        row, text = wrong[0], wrong[0].text.split("\n")[0][:60]
        allowed = (
            f"{row.expected_columns} cells between {DELIMITERS[delimiter]}, not"
            f" {row.actual_columns}"
        )
        raise reject(f"{name}, line {row.number + first - 1}: row", text, allowed) from None
    if table.num_rows != len(lines):
        raise ArgumentError(f"{name}: not CSV: a quoted cell goes over several lines")
    return table.to_pandas().set_axis(range(columns), axis=1)
