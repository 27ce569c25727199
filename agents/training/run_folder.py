"""The run folder: lock, config and metrics as JSON lines; see `checkpoint` for the checkpoint."""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from agents.interface.output_files import PART_PREFIX, atomic_file
from hybrid_env.checks import reject

try:
    import fcntl
except ImportError:
    # Not a POSIX system: no lock.
    fcntl = None  # type: ignore[assignment]

CONFIG = "config.json"
METRICS = "metrics.jsonl"


def is_free(folder: Path) -> bool:
    """Return whether a new run can use a folder: it has no files, or none with results."""
    if not folder.is_dir():
        return not folder.exists()
    names = {path.name for path in folder.iterdir()}
    results = {
        name
        for name in names - {".training.lock", CONFIG}
        if not name.startswith((PART_PREFIX, "events.out.tfevents"))
    }
    return not names or (".training.lock" in names and not results)


def delete_temporary_files(folder: Path) -> None:
    """Delete the incomplete files that a killed training left in a locked folder."""
    for path in folder.glob(f"{PART_PREFIX}*"):
        with suppress(OSError):
            path.unlink()


@contextmanager
def lock(folder: Path) -> Iterator[None]:
    """Context manager that locks a run folder; a lock ends with its process, also with a killed
    one.
    """
    with (folder / ".training.lock").open("a", encoding="utf-8") as file:
        if fcntl is not None:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise reject(
                    "run", str(folder), "a run folder in which no other training runs"
                ) from None
            except OSError:
                # The file system has no locks.
                pass
        yield


@contextmanager
def writing(path: Path) -> Iterator[Path]:
    """Context manager that names the file or folder that cannot be written, in one line."""
    try:
        yield path
    except OSError as error:
        raise reject("file", str(path), f"a path that can be written ({error.strerror})") from None


def append_metrics(folder: Path, step: int, metrics: Mapping[str, Any]) -> None:
    """Append one line with a JSON object; a resumed run appends to the same file."""
    with writing(folder / METRICS) as path, path.open("a", encoding="utf-8") as file:
        file.write(json.dumps({"step": step} | dict(metrics)) + "\n")


def read_metrics(folder: Path) -> list[dict[str, Any]]:
    """Read the lines of the metrics file, skipping incomplete or damaged ones."""
    path = folder / METRICS
    if not path.is_file():
        return []
    rows = []
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
        with suppress(ValueError, RecursionError):
            rows.append(json.loads(line))
    return rows


def drop_metrics_after(folder: Path, step: int) -> None:
    """Delete the metrics logged after a checkpoint; the resumed run logs them again."""
    if (folder / METRICS).is_file():
        with atomic_file(folder / METRICS) as part:
            kept = [row for row in read_metrics(folder) if row["step"] <= step]
            part.write_text("".join(json.dumps(row) + "\n" for row in kept), encoding="utf-8")
