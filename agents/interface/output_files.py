"""Atomic writing of output files: to a temporary file in the same folder, which is then renamed."""

import json
import os
import secrets
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from operator import methodcaller
from pathlib import Path
from typing import Any

import numpy as np
from safetensors import SafetensorError

from hybrid_env.checks import reject

PART_PREFIX = ".hybridtrack-"


def output_folder(path: Path) -> Path:
    """Create the output folder of a command, given by the flag `out`, if it does not exist."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        raise reject("out", str(path), f"a writable folder ({_reason(error)})") from None
    return path


@contextmanager
def atomic_file(path: Path) -> Iterator[Path]:
    """Context manager that yields the path of an empty temporary file for writing.

    The file replaces `path` if the block succeeds, and is removed otherwise.
    """
    part = path.parent / f"{PART_PREFIX}{secrets.token_hex(8)}.part{path.suffix[:8]}"
    try:
        if path.exists() and not path.is_file():
            raise reject("file", str(path), "a file that can be written, not a folder or device")
        # Exclusive, so that no link that someone else has put there is followed.
        part.touch(exist_ok=False)
        yield part
        os.replace(part, path)
    except BrokenPipeError:
        raise
    except (OSError, SafetensorError) as error:
        raise reject("file", str(path), f"a file that can be written ({_reason(error)})") from None
    finally:
        with suppress(OSError):
            part.unlink()


@contextmanager
def atomic_folder(path: Path) -> Iterator[Path]:
    """Context manager that yields an empty temporary folder, whose files appear in `path` together.

    If the block fails, nothing appears, and `path` is removed if it is empty. Other files in it
    stay.
    """
    output_folder(path)
    try:
        with tempfile.TemporaryDirectory(prefix=PART_PREFIX, dir=path) as part:
            yield Path(part)
            for file in sorted(inner for inner in Path(part).rglob("*") if inner.is_file()):
                target = path / file.relative_to(part)
                target.parent.mkdir(parents=True, exist_ok=True)
                os.replace(file, target)
    except OSError as error:
        raise reject(
            "file", str(path), f"a folder that can be written ({_reason(error)})"
        ) from None
    finally:
        with suppress(OSError):
            # Only if it is empty.
            path.rmdir()


def _reason(error: Exception) -> str:
    """Short text of an error, without the path."""
    return (getattr(error, "strerror", None) or str(error))[:80]


def finite(values: Any) -> Any:
    """Return an array as lists of numbers, with None for values that are not finite."""
    array = np.asarray(values)
    if array.ndim:
        return [finite(row) for row in array]
    return array.item() if np.isfinite(array) else None


def write_json(path: Path, value: Any) -> None:
    """Write indented JSON, of objects what their `as_json` returns; NaN and infinities are
    refused.
    """
    text = json.dumps(value, indent=2, allow_nan=False, default=methodcaller("as_json"))
    with atomic_file(path) as part:
        part.write_text(text + "\n", encoding="utf-8")


def save_figure(figure: Any, path: Path) -> None:
    """Write a figure of Matplotlib as PNG."""
    with atomic_file(path) as part:
        figure.savefig(part, format="png")


def write_files(folder: Path, files: Mapping[str, Any]) -> str:
    """Write plain values (.json) and figures of Matplotlib (.png); return a line with the names."""
    for name, content in files.items():
        if name.endswith(".json"):
            write_json(folder / name, content)
        else:
            save_figure(content, folder / name)
    return f"Files in {folder}: {', '.join(files)}"
