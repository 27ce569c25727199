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
from numba.extending import register_jitable

OPTIONS: Any = {"error_model": "numpy", "nogil": True}

inlined: Any = njit(**OPTIONS, inline="always")
"""Decorator of a scalar formula or a part of a loop, which numba inlines before it infers types."""

internal: Any = register_jitable(**OPTIONS)
"""Decorator of a function that is compiled when a compiled function calls it. Python runs it as it is."""


def compiled(function: Callable[..., Any]) -> Any:
    """Decorator of a function called from Python. Its machine code is cached on disk, including callees."""
    dispatcher = njit(**OPTIONS, cache=True)(function)
    if dispatcher is not function:  # as with NUMBA_DISABLE_JIT
        _drop_stale_cache_once(dispatcher.stats.cache_path, function.__module__.partition(".")[0])
    return dispatcher


def announce_compilation(dispatcher: Any) -> None:
    """Print one line to stderr if the next call of a function compiles it, nothing if it is cached."""
    if getattr(dispatcher, "signatures", True):
        return
    cache, name = dispatcher.stats.cache_path, dispatcher.py_func.__qualname__
    if cache is None or not any(Path(cache).glob(f"*.{name}-*.nbi")):
        print("HybridTrack: compiling once, about 10 s", file=sys.stderr)


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
def _drop_stale_cache_once(cache: str, package: str) -> None:
    """Check a cache folder once, against the sources of its package and of the core."""
    folders = getattr(sys.modules.get(package), "__path__", [])
    sources = [source for folder in folders for source in Path(folder).rglob("*.py")]
    drop_stale_cache(cache, [*sources, *Path(__file__).parent.glob("*.py")])
