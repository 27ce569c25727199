"""The files in which numba caches compiled functions: outdated and damaged ones are removed.

numba compares a cached function with the file that defines it, but not with the files of its callees: after a
change of `motion.py` it would use an outdated kernel without notice. It has no checksums either: a damaged
file would be executed as machine code (`compilation` compares them). numba's public interface has no hook for
either, therefore this file knows the names of its cache files, `<file>.<function>-*.nbi` and `.nbc` in the
folder `stats.cache_path` of a function. If these names change, nothing is found, and nothing is removed.
"""

import functools
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

PATTERN = "*.nb[ic]"


@functools.cache
def drop_stale_files(cache: str | None, package: str) -> None:
    """Remove the cached functions of a folder if a source is newer than the oldest of them; checked once.

    Args:
        cache: cache folder of numba, None if there is no cache.
        package: whose sources, and those of the core, may be compiled into the cached functions.
    """
    cached = [] if cache is None else list(Path(cache).glob(PATTERN))
    folders = [*getattr(sys.modules.get(package), "__path__", []), Path(__file__).parent]
    with suppress(OSError, ValueError):  # another process removes the same files, or the folder is read-only
        newest = max(path.stat().st_mtime for folder in folders for path in Path(folder).rglob("*.py"))
        if newest > min(path.stat().st_mtime for path in cached):
            for path in cached:
                path.unlink(missing_ok=True)


def cache_name(dispatcher: Any) -> Path | None:
    """Return what the names of the files of a function begin with, None if there is no cache."""
    folder, code = dispatcher.stats.cache_path, dispatcher.py_func.__code__
    name = f"{Path(code.co_filename).stem}.{dispatcher.py_func.__qualname__}"
    return None if folder is None else Path(folder) / name


def cached_files(name: Path | None) -> list[Path]:
    """Return the files of a function."""
    return [] if name is None else sorted(name.parent.glob(f"{name.name}-{PATTERN}"))
