"""From a Parquet file to its table."""

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet

from baselines.recordings.reading.cells import Table
from baselines.recordings.reading.names import role_of
from baselines.recordings.reading.sizes import check_bytes, check_size
from hybrid_env.checks import ArgumentError, reject


def read_parquet(content: bytes, name: str) -> Table:
    """Read the columns of numbers, texts and times. name: of the file, for messages."""
    unnamed = "__index_level_0__"
    notes: list[str] = []
    try:
        file = pyarrow.parquet.ParquetFile(pa.BufferReader(content))
        texts = [one.name for one in file.schema_arrow if _is_text(one.type)]
        # Texts that repeat are stored once, and may be far larger than the file.
        file = pyarrow.parquet.ParquetFile(pa.BufferReader(content), read_dictionary=texts)
        rows = file.metadata.num_rows
        names = _flat_columns(file, name, notes)
        check_size(rows, name, len(names))
        everything = len(names) == len(file.schema_arrow.names)
        table = file.read(columns=None if everything else names, use_threads=False)
        check_bytes(sum(map(_text_bytes, table.columns)), name)
        frame = table.cast(_without_dictionaries(table.schema)).to_pandas(ignore_metadata=True)
    except ArgumentError:
        raise
    except (pa.ArrowException, OSError, ValueError, TypeError, OverflowError) as error:
        raise ArgumentError(f"{name}: the Parquet file is damaged ({error})") from None
    if not rows:
        raise reject("file", name, "a file with rows, not an empty table")
    # Pandas writes an index without a name as the last column.
    order = sorted(range(len(names)), key=lambda k: names[k] != unnamed)
    frame = frame.iloc[:, order].set_axis(range(len(names)), axis=1)
    return Table(
        name,
        frame,
        tuple("" if names[k] == unnamed else names[k] for k in order),
        notes=notes,
    )


def _flat_columns(file: pyarrow.parquet.ParquetFile, name: str, notes: list[str]) -> list[str]:
    """Return the columns whose cells are numbers, texts or times; refuse another one that is
    needed, and sizes that are too large.
    """
    kept = []
    others = []
    for field in file.schema_arrow:
        kind = field.type.value_type if pa.types.is_dictionary(field.type) else field.type
        if not pa.types.is_nested(kind) and not _is_bytes(kind):
            kept.append(field.name)
        elif role_of(field.name):
            raise reject(
                f"{name}: type of {field.name}",
                str(field.type),
                "numbers, texts or times",
            )
        else:
            others.append(field.name)
    if others:
        notes.append(
            f"columns of other types left out: {', '.join(others[:5])}" + " ..." * (len(others) > 5)
        )
    groups = [file.metadata.row_group(k) for k in range(file.metadata.num_row_groups)]
    chunks = [group.column(k) for group in groups for k in range(group.num_columns)]
    wanted = set(kept)
    check_bytes(
        sum(one.total_uncompressed_size for one in chunks if one.path_in_schema in wanted),
        name,
    )
    return kept


def _text_bytes(column: pa.ChunkedArray) -> int:
    """Return the size of the texts of a column that are stored once and repeated."""
    if not _repeats(column.type):
        return 0
    sizes = [pc.binary_length(chunk.dictionary).take(chunk.indices) for chunk in column.chunks]
    return sum(pc.sum(one.cast(pa.int64())).as_py() or 0 for one in sizes)


def _without_dictionaries(schema: pa.Schema) -> pa.Schema:
    """Return a schema with the texts themselves."""
    return pa.schema(
        [one.with_type(one.type.value_type) if _repeats(one.type) else one for one in schema]
    )


def _repeats(kind: pa.DataType) -> bool:
    """Return whether texts are stored once and repeated."""
    return pa.types.is_dictionary(kind) and _is_text(kind.value_type)


def _is_bytes(kind: pa.DataType) -> bool:
    types = pa.types
    of_any_length = types.is_binary(kind) or types.is_large_binary(kind)
    return of_any_length or types.is_fixed_size_binary(kind)


def _is_text(kind: pa.DataType) -> bool:
    return pa.types.is_string(kind) or pa.types.is_large_string(kind)
