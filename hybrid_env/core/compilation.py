"""Compilation: numba's `njit` with common options.

With NumPy's error model a division has no branch that raises, so that loops over lanes compile to SIMD code.
The GIL is released, so that threads can step different tracks in parallel.
"""

import functools
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from numba import njit

OPTIONS: Any = {"error_model": "numpy", "nogil": True}

formula: Any = njit(**OPTIONS, forceinline=True)
"""Decorator of a scalar function that is inlined into the calling loop."""

internal: Any = njit(**OPTIONS)
"""Decorator of a function called by other compiled functions."""


def compiled(function: Callable[..., Any]) -> Any:
    """Decorator of a function called from Python. Its machine code is cached on disk, including callees."""
    dispatcher = njit(**OPTIONS, cache=True)(function)
    _drop_stale_cache_once(dispatcher.stats.cache_path, Path(function.__code__.co_filename).parent)
    return dispatcher


def announce_compilation(dispatcher: Any) -> None:
    """Print one line to stderr if a function is about to be compiled, nothing if it is cached."""
    name = dispatcher.py_func.__qualname__
    cache = dispatcher.stats.cache_path
    if not dispatcher.signatures and not (cache and any(Path(cache).glob(f"*.{name}-*.nbi"))):
        print("HybridTrack: compiling once, about 8 s", file=sys.stderr)


def drop_stale_cache(cache: str | Path | None, sources: list[Path]) -> None:
    """Remove the cached functions of a folder if a source is newer than the oldest of them.

    numba compares a cached function with the file that defines it, but not with the files of its callees.
    After a change of `motion.py` it would use an outdated `kernel.py` without notice.

    Args:
        cache: cache folder of numba, None if there is no cache.
        sources: files that may be compiled into the cached functions.
    """
    cached = [] if cache is None else list(Path(cache).glob("*.nb[ic]"))
    if not cached:
        return
    with suppress(OSError):  # another process may remove the same files, or the folder may be read-only
        newest = max(source.stat().st_mtime for source in sources)
        if newest > min(path.stat().st_mtime for path in cached):
            for path in cached:
                path.unlink(missing_ok=True)


@functools.cache
def _drop_stale_cache_once(cache: str, folder: Path) -> None:
    """Check each source folder once: its files, those of its sibling folders, and those of the core."""
    drop_stale_cache(cache, [*folder.parent.rglob("*.py"), *Path(__file__).parent.glob("*.py")])
