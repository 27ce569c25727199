"""How functions are compiled: numba's public `njit` with one set of options.

NumPy's error model lets a division stand in a loop without the branch that would raise, so that loops over
lanes become SIMD code. The GIL is released, so that threads can step different tracks at the same time.
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
"""A scalar function that becomes part of the loop it is called in."""

internal: Any = njit(**OPTIONS)
"""A function that other compiled functions call."""


def compiled(function: Callable[..., Any]) -> Any:
    """A function that Python calls. Its machine code is cached on disk with all that it calls."""
    dispatcher = njit(**OPTIONS, cache=True)(function)
    _drop_stale_cache_once(dispatcher.stats.cache_path, Path(function.__code__.co_filename).parent)
    return dispatcher


def announce_compilation(dispatcher: Any) -> None:
    """Say on stderr, in one line, that a function is about to be compiled; silent if it is cached."""
    name = dispatcher.py_func.__qualname__
    cache = dispatcher.stats.cache_path
    if not dispatcher.signatures and not (cache and any(Path(cache).glob(f"*.{name}-*.nbi"))):
        print("HybridTrack: compiling once, about 8 s", file=sys.stderr)


def drop_stale_cache(cache: str | Path | None, sources: list[Path]) -> None:
    """Remove cached functions if a source is newer than the oldest of them.

    numba checks a cached function against the file that it stands in, not against the files whose functions
    were compiled into it. After a change of `motion.py` an old `kernel.py` would be used silently.

    Args:
        cache: folder where numba keeps the functions, None where it keeps none.
        sources: files that may be part of them.
    """
    cached = [] if cache is None else list(Path(cache).glob("*.nb[ic]"))
    if not cached:
        return
    with suppress(OSError):  # another process may do the same, or the folder may be read-only
        newest = max(source.stat().st_mtime for source in sources)
        if newest > min(path.stat().st_mtime for path in cached):
            for path in cached:
                path.unlink(missing_ok=True)


@functools.cache
def _drop_stale_cache_once(cache: str, folder: Path) -> None:
    """Once per folder of sources: the files of the folder, its neighbours, and this one."""
    drop_stale_cache(cache, [*folder.parent.rglob("*.py"), *Path(__file__).parent.glob("*.py")])
