"""How large the files of recordings may be. What a file states of its size is checked before it
is read.
"""

from hybrid_env.checks import ArgumentError, reject

# Of a file, and of what it holds.
MAX_BYTES = 250_000_000
# Size that a gzip file may hold, over its own, and in any case.
MAX_RATIO, ALWAYS_BYTES = 50, 10_000_000
# `hybridtrack track` then needs a few gigabytes of memory at most.
MAX_ROWS = 2_500_000
MAX_COLUMNS = 2_000
MAX_CELLS = 50_000_000
# Of a GPX file.
MAX_TAGS = 10_000_000


def check_size(rows: int, name: str, columns: int = 1) -> None:
    """Check that the rows and cells of a file are not too many, before they are read."""
    if rows > MAX_ROWS:
        raise ArgumentError(f"{name}: {rows:,} rows, more than {MAX_ROWS:,}: split the recording")
    if columns > MAX_COLUMNS:
        raise ArgumentError(f"{name}: {columns:,} columns: at most {MAX_COLUMNS:,} are allowed")
    if rows * columns > MAX_CELLS:
        raise ArgumentError(
            f"{name}: {rows:,} rows of {columns:,} columns, more than {MAX_CELLS:,} cells"
        )


def check_bytes(size: int, name: str) -> None:
    """Check that the cells of a file are not too large."""
    if size > MAX_BYTES:
        allowed = (
            f"at most {MAX_BYTES / 1e6:.0f} MB when decompressed, not {size / 1e6:.0f} MB: split"
            " the recording"
        )
        raise reject("file", name, allowed)
