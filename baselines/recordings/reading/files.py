"""From a file to its table. The kind of a file is found by its content, whatever its name is."""

import gzip
import io
import os
import zlib
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from baselines.recordings.reading.gpx import read_gpx
from baselines.recordings.reading.table import Table, short_name
from baselines.recordings.reading.text import MAX_ROWS, read_text
from hybrid_env.checks import ArgumentError, reject

MAX_BYTES = 250_000_000  # of a file, and of what it holds
INDEX = "__index_level_0__"
ALLOWED = "a CSV, TSV, Parquet or GPX file"


def read_table(path: str | os.PathLike[str]) -> Table:
    """Read the cells of a file.

    Raises:
        ArgumentError: it cannot be read, or is none of the kinds of files.
    """
    name = short_name(str(path))
    content = _content(Path(path), name)
    if content[:2] == b"\x1f\x8b":
        content = _decompressed(content, name)
    start = content[:1000].removeprefix(b"\xef\xbb\xbf").lstrip()
    if start[:4] == b"PAR1":
        return _read_parquet(content, name)
    if start[:1] == b"<":
        return read_gpx(content, name)
    if start[:4] in (b"PK\x03\x04", b"\xd0\xcf\x11\xe0"):
        raise reject("file", name, f"{ALLOWED}, not a workbook or archive: export it as CSV")
    return read_text(content, name)


def _content(path: Path, name: str) -> bytes:
    try:
        if path.is_dir():
            raise reject("file", name, f"{ALLOWED}, not a folder")
        if not path.is_file():  # for example a named pipe, which would wait for its writer
            raise reject("file", name, f"an existing file: {ALLOWED}")
        size = path.stat().st_size
        if size > MAX_BYTES:
            allowed = (
                f"a file of at most {MAX_BYTES / 1e6:.0f} MB, not {size / 1e6:.0f} MB: split the recording"
            )
            raise reject("file", name, allowed)
        return path.read_bytes()
    except (OSError, ValueError) as error:
        if isinstance(error, ArgumentError):
            raise
        reason = getattr(error, "strerror", None) or str(error)
        raise reject("file", name, f"a file that can be read ({reason})") from None


def _decompressed(content: bytes, name: str) -> bytes:
    try:
        with gzip.open(io.BytesIO(content)) as stream:
            inner = stream.read(MAX_BYTES + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise ArgumentError(f"{name}: the gzip file is damaged or cut off ({error})") from None
    if len(inner) > MAX_BYTES:
        raise reject("file", name, f"at most {MAX_BYTES / 1e6:.0f} MB when decompressed: split the recording")
    return inner


def _read_parquet(content: bytes, name: str) -> Table:
    try:
        file = pq.ParquetFile(pa.BufferReader(content))
        rows, names = file.metadata.num_rows, tuple(file.schema_arrow.names)
        if rows > MAX_ROWS:
            raise ArgumentError(f"{name}: {rows:,} rows, more than {MAX_ROWS:,}: split the recording")
        frame = file.read(use_threads=False).to_pandas(ignore_metadata=True)
    except (pa.ArrowException, OSError, ValueError, TypeError, OverflowError) as error:
        if isinstance(error, ArgumentError):
            raise
        raise ArgumentError(f"{name}: the Parquet file is damaged ({error})") from None
    if not rows:
        raise reject("file", name, "a file with rows, not an empty table")
    frame.columns = range(len(names))
    if INDEX in names:  # pandas writes an index without a name as the last column
        order = [names.index(INDEX), *(k for k, one in enumerate(names) if one != INDEX)]
        frame, names = frame[order], ("", *(one for one in names if one != INDEX))
        frame.columns = range(len(names))
    return Table(name, frame, names)
