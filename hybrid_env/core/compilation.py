"""Compilation: numba's `njit` with common options, and a cache that may be missing or damaged.

With NumPy's error model a division has no branch that raises, so that loops over lanes compile to SIMD code.
The GIL is released, so that threads can step different tracks in parallel.

With the environment variable NUMBA_BOUNDSCHECK=1 every index is checked, which is slow. The code is then only
cached in the folder NUMBA_CACHE_DIR, because numba does not distinguish it from code without checks.
"""

import functools
import gc
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numba
from numba import njit, typeof
from numba.extending import register_jitable

from hybrid_env.core.cached_files import CachedFiles, drop_stale_files

config: Any = numba.config  # filled at run time

OPTIONS: Any = {"error_model": "numpy", "nogil": True}

inlined: Any = njit(**OPTIONS, inline="always")
"""Decorator of a scalar formula or a part of a loop, which numba inlines before it infers types."""

CALLEE_OPTIONS: Any = OPTIONS | {"no_cfunc_wrapper": True}
"""Options of functions that only compiled functions call, and C never."""

internal: Any = register_jitable(**CALLEE_OPTIONS)
"""Decorator of a function that is compiled when a compiled function calls it. Python runs it as it is."""


def compiled(function: Callable[..., Any]) -> Any:
    """Decorator of a function called from Python, after `prepare`. Its machine code is cached on disk."""
    if config.DISABLE_JIT:
        return function
    cached = not config.BOUNDSCHECK or bool(config.CACHE_DIR)
    try:
        dispatcher = njit(**OPTIONS, cache=cached)(function)
    except RuntimeError:  # numba found no folder that it can write to
        return njit(**OPTIONS)(function)
    drop_stale_files(dispatcher.stats.cache_path, function.__module__.partition(".")[0])
    return dispatcher


def prepare(dispatcher: Any, *arguments: Any) -> None:
    """Compile a `compiled` function for the types of these arguments, or load it from the cache.

    One line on stderr announces the first compilation of a process. Without a writable cache every process
    compiles. Cached files that are damaged or cannot be loaded are removed.

    Raises:
        RuntimeError: NUMBA_DISABLE_JIT is set, or a damaged cache cannot be removed.
    """
    if config.DISABLE_JIT:
        raise RuntimeError("NUMBA_DISABLE_JIT is set: only the scalar formulas run without compilation")
    types = tuple(map(typeof, arguments))
    if types in dispatcher.signatures:
        return
    files = CachedFiles(dispatcher)
    files.remove_damaged()
    found = files.paths() != []
    if not found:
        _announce()
    try:
        with _collector_paused():
            dispatcher.compile(types)
    except Exception:  # unpickling a damaged file can raise anything
        if types in dispatcher.signatures:
            return  # compiled, but not saved: the disk is full or read-only
        if not found:
            raise
        files.remove()
        prepare(dispatcher, *arguments)
        return
    files.save_checksums()


@functools.cache
def _announce() -> None:
    """Announce a compilation, once in a process, although a command may compile several functions."""
    print("HybridTrack: compiling once, about 10 s", file=sys.stderr)


@contextmanager
def _collector_paused() -> Iterator[None]:
    """Pause Python's garbage collector, which would take a fifth of the time of a compilation."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()
