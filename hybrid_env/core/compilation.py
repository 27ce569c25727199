"""Compilation: numba's `njit` with common options, and a cache that may be missing or damaged.

With NumPy's error model a division has no branch that raises, so that loops over lanes compile to SIMD code.
The GIL is released, so that threads can step different tracks in parallel.

With the environment variable NUMBA_BOUNDSCHECK=1 every index is checked, which is slow. The code is then only
cached in the folder NUMBA_CACHE_DIR, because numba does not distinguish it from code without checks.
"""

import functools
import gc
import os
import sys
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numba
from numba import njit, typeof
from numba.extending import register_jitable

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
    if dispatcher.stats.cache_path is not None:
        _drop_stale_cache_once(dispatcher.stats.cache_path, function.__module__.partition(".")[0])
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
    cache = _CachedFiles(dispatcher)
    cache.remove_damaged()
    found = cache.paths() != []
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
        cache.remove()
        prepare(dispatcher, *arguments)
        return
    cache.save_checksums()


@functools.cache
def _announce() -> None:
    """Announce a compilation, once in a process, although a command may compile several functions."""
    print("HybridTrack: compiling once, about 10 s", file=sys.stderr)


class _CachedFiles:
    """The files in which numba caches one function, and their checksums in one more file."""

    def __init__(self, dispatcher: Any):
        folder = dispatcher.stats.cache_path
        self.folder = None if folder is None else Path(folder)
        self.name = f"{Path(dispatcher.py_func.__code__.co_filename).stem}.{dispatcher.py_func.__qualname__}"

    def paths(self) -> list[Path]:
        return [] if self.folder is None else sorted(self.folder.glob(f"{self.name}-*.nb[ic]"))

    def remove_damaged(self) -> None:
        """Remove all files if one of them differs from its checksum."""
        paths = self.paths()
        if paths and self._checksums().exists():
            known = set(self._checksums().read_text(errors="replace").splitlines())
            names = {line.partition(" ")[2] for line in known}
            if any(path.name in names and _checksum(path) not in known for path in paths):
                self.remove()

    def save_checksums(self) -> None:
        """Write the checksums, unless the folder is not writable."""
        text = "".join(f"{_checksum(path)}\n" for path in self.paths())
        with suppress(OSError):
            if text and not (self._checksums().exists() and self._checksums().read_text() == text):
                part = self._checksums().with_suffix(f".{os.getpid()}")
                part.write_text(text)
                part.replace(self._checksums())

    def remove(self) -> None:
        """Remove the files. Raises `RuntimeError` if that is not allowed."""
        try:
            for path in self.paths():
                path.unlink(missing_ok=True)
        except OSError:
            raise RuntimeError(
                f"the compilation cache {self.folder} is damaged: remove it, or set NUMBA_CACHE_DIR"
            ) from None

    def _checksums(self) -> Path:
        assert self.folder is not None
        return self.folder / f"{self.name}.checksums"


def _checksum(path: Path) -> str:
    """Return the line of a file in the file of checksums."""
    return f"{zlib.crc32(path.read_bytes()):08x} {path.name}"


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
