"""Atomic writing of output files: to a temporary file in the same folder, which is then renamed."""

import csv
import json
import os
import secrets
import shutil
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from operator import methodcaller
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError

from hybrid_env.checks import ArgumentError, reject

PART_PREFIX = ".hybridtrack-"
WRITTEN_ROWS = 50_000
# Files in a line.
MOST_NAMED = 8
# Seconds; a temporary file without a change for so long is of a killed process.
STALE_AFTER = 86_400.0

Column: TypeAlias = Sequence[Any] | NDArray[Any]


def output_folder(name: str, path: Path) -> Path:
    """Create the output folder of a command, given by the flag `name`, if it does not exist."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        raise reject(name, str(path), f"a writable folder ({_reason(error)})") from None
    return path


@contextmanager
def atomic_file(path: Path) -> Iterator[Path]:
    """Context manager that yields the path of an empty temporary file for writing.

    The file replaces `path` if the block succeeds, and is removed otherwise. Temporary files of
    killed processes in the same folder are removed.
    """
    part = path.parent / f"{PART_PREFIX}{secrets.token_hex(8)}.part{path.suffix[:8]}"
    try:
        if path.exists() and not path.is_file():
            raise reject("file", str(path), "a file that can be written, not a folder or device")
        _remove_stale_parts(path.parent)
        # Exclusive, so that no link that someone else has put there is followed.
        part.touch(exist_ok=False)
        yield part
        os.replace(part, path)
    except (BrokenPipeError, ArgumentError):
        raise
    except (OSError, SafetensorError) as error:
        raise reject("file", str(path), f"a file that can be written ({_reason(error)})") from None
    finally:
        with suppress(OSError):
            part.unlink()


@contextmanager
def atomic_folder(name: str, path: Path) -> Iterator[Path]:
    """Context manager that yields an empty temporary folder, whose files appear in `path` together.

    If the block fails, nothing appears, and `path` is removed if it is empty. Other files in it
    stay.
    """
    output_folder(name, path)
    part = path / f"{PART_PREFIX}{secrets.token_hex(8)}.part"
    try:
        _remove_stale_parts(path)
        part.mkdir()
        yield part
        for file in sorted(one for one in part.rglob("*") if one.is_file()):
            target = path / file.relative_to(part)
            target.parent.mkdir(parents=True, exist_ok=True)
            os.replace(file, target)
    except OSError as error:
        raise reject(
            "file",
            str(path),
            f"a folder that can be written ({_reason(error)})",
        ) from None
    finally:
        shutil.rmtree(part, ignore_errors=True)
        with suppress(OSError):
            # Only if it is empty.
            path.rmdir()


def _remove_stale_parts(folder: Path) -> None:
    for part in folder.glob(f"{PART_PREFIX}*.part*"):
        with suppress(OSError):
            if part.lstat().st_mtime < time.time() - STALE_AFTER:
                shutil.rmtree(part) if part.is_dir() and not part.is_symlink() else part.unlink()


def _reason(error: Exception) -> str:
    """Short text of an error, without the path."""
    return (getattr(error, "strerror", None) or str(error))[:80]


def finite(values: Any) -> Any:
    """Return an array as lists of numbers, with None for values that are not finite."""
    array = np.asarray(values)
    return (
        [finite(one) for one in array]
        if array.ndim
        else array.item()
        if np.isfinite(array)
        else None
    )


def write_json(path: Path, value: Any) -> None:
    """Write indented JSON, of objects what their `as_json` returns; NaN and infinities are
    refused.
    """
    try:
        text = json.dumps(value, indent=2, allow_nan=False, default=methodcaller("as_json"))
    except ValueError:
        raise ArgumentError(f"{path.name} is not written: its values are not all finite") from None
    with atomic_file(path) as part:
        part.write_text(text + "\n", encoding="utf-8")


def save_figure(figure: Any, path: Path) -> None:
    """Write a figure of Matplotlib as PNG."""
    with atomic_file(path) as part:
        figure.savefig(part, format="png")


def write_files(folder: Path, files: Mapping[str, Any]) -> str:
    """Write plain values (.json), texts (.md) and figures of Matplotlib (.png); return a line
    with most names.
    """
    for name, content in files.items():
        if name.endswith(".json"):
            write_json(folder / name, content)
        elif name.endswith(".md"):
            with atomic_file(folder / name) as part:
                part.write_text(content, encoding="utf-8")
        else:
            save_figure(content, folder / name)
    names = [*files] if len(files) <= MOST_NAMED else [*list(files)[:3], f"{len(files) - 3} more"]
    return f"Files in {folder}: {', '.join(names)}"


def write_table(path: str | os.PathLike[str], columns: Mapping[str, Column]) -> None:
    """Write columns of equal length as CSV with a header, floats without loss of precision."""
    lengths = {name: len(column) for name, column in columns.items()}
    if len(set(lengths.values())) > 1:
        raise reject("columns", lengths, "columns of equal length")
    with atomic_file(Path(path)) as part, part.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(columns)
        # Bounds the memory.
        for first in range(0, max(lengths.values(), default=0), WRITTEN_ROWS):
            parts = [column[first : first + WRITTEN_ROWS] for column in columns.values()]
            lists = [one.tolist() if isinstance(one, np.ndarray) else one for one in parts]
            writer.writerows(zip(*lists, strict=True))
