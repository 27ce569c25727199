"""Files that are whole or not there: written beside their place, then renamed."""

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from hybrid_env.checks import reject


def output_folder(name: str, path: Path) -> Path:
    """The folder of a command's output, made if it is not there; name is the flag it came from."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise reject(name, str(path), f"a folder that can be written to ({error.strerror})") from None
    return path


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A path to write to; it takes the place of `path` when the block ends well, else it is removed.

    Raises:
        ArgumentError: the place cannot be written to.
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
    """Write readable JSON; NaN and infinities are refused."""
    with whole_file(path) as part:
        part.write_text(json.dumps(value, indent=2, allow_nan=False) + "\n", encoding="utf-8")
