"""Atomic writing of output files: to a temporary file in the same folder, which is then renamed."""

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from hybrid_env.checks import reject


def output_folder(name: str, path: Path) -> Path:
    """Create the output folder of a command if it does not exist.

    Args:
        name: name of the flag, for the error message.
        path: path of the folder.

    Raises:
        ArgumentError: the folder cannot be created.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise reject(name, str(path), f"a writable folder ({error.strerror})") from None
    return path


@contextmanager
def atomic_file(path: Path) -> Iterator[Path]:
    """Context manager that yields the path of a temporary file for writing.

    The file replaces `path` if the block succeeds, and is removed otherwise.

    Raises:
        ArgumentError: the file cannot be written.
    """
    part = path.with_name(f".{path.stem}.{os.getpid()}.part{path.suffix}")
    try:
        yield part
        os.replace(part, path)
    except OSError as error:
        raise reject("file", str(path), f"a file that can be written ({error.strerror or error})") from None
    finally:
        with suppress(OSError):
            part.unlink()


def write_json(path: Path, value: Any) -> None:
    """Write indented JSON.

    Raises:
        ArgumentError: the file cannot be written.
        ValueError: the value contains NaN or infinities.
    """
    with atomic_file(path) as part:
        part.write_text(json.dumps(value, indent=2, allow_nan=False) + "\n", encoding="utf-8")
