"""Compilation: numba's `njit` with common options, and a cache that may be missing, outdated or
damaged.

With NumPy's error model a division has no branch that raises, so that loops over lanes compile to
SIMD code. Without the GIL threads step different tracks in parallel. With NUMBA_BOUNDSCHECK=1 every
index is checked; the code is then only cached in the folder NUMBA_CACHE_DIR, because numba does not
tell it from code without checks. numba compares a cached function with the file that defines it,
but not with those of its callees, and has no checksums. Its public interface has no hook for
either: this file stands before the method `compile` of every function, and knows the names of its
cache files, `<file>.<function>-*.nbi` and `.nbc` in the folder `stats.cache_path` of a function. If
these names change, nothing is found, and nothing is removed.
"""

import functools
import gc
import itertools
import os
import sys
import threading
import zlib
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import numba
from numba import njit, typeof
from numba.extending import register_jitable

# Filled at run time.
config: Any = numba.config

PATTERN = "*.nb[ic]"
# Else one with the file of a callee could wait for one that compiles its caller.
_one_thread = threading.RLock()
# Of the functions that this process has compiled.
_number = itertools.count(1)

OPTIONS: Any = {
    "error_model": "numpy",
    "nogil": True,
    "no_cfunc_wrapper": True,
}
"""Options of all functions. C never calls one."""

inlined: Any = njit(**OPTIONS, inline="always")
"""Decorator of a scalar formula or a part of a loop, which numba inlines before it infers types."""

internal: Any = register_jitable(**OPTIONS)
"""Decorator of a function that is compiled when a compiled function calls it. Python runs it as
it is.
"""

summing: Any = register_jitable(**OPTIONS, fastmath={"reassoc"})
"""The same for a function whose sums may be taken in any order, so that they become SIMD code.
Their rounding depends on the processor: not for environments and banks.
"""


def compiled(function: Callable[..., Any]) -> Any:
    """Decorator of a function called from Python. Its machine code is cached on disk: it is
    compiled or loaded at its first call, or by `prepare`.
    """
    if config.DISABLE_JIT:
        return function
    cached = not config.BOUNDSCHECK or bool(config.CACHE_DIR)
    try:
        dispatcher = njit(**OPTIONS, cache=cached)(function)
    except RuntimeError:
        # Numba found no folder that it can write to.
        dispatcher = njit(**OPTIONS)(function)
    drop_stale_files(dispatcher.stats.cache_path, function.__module__.partition(".")[0])
    # Numba calls it for each new types of arguments, also where compiled code calls the function.
    dispatcher.compile = functools.partial(_compile, dispatcher, dispatcher.compile)
    return dispatcher


@functools.cache
def drop_stale_files(cache: str | None, package: str) -> None:
    """Remove the functions in a cache folder if a source of the package or the core is newer
    than the oldest.
    """
    cached = [] if cache is None else list(Path(cache).glob(PATTERN))
    folders = [*getattr(sys.modules.get(package), "__path__", []), Path(__file__).parent]
    # Another process removes the same files, or the folder is read-only.
    with suppress(OSError, ValueError):
        newest = max(
            path.stat().st_mtime for folder in folders for path in Path(folder).rglob("*.py")
        )
        if newest > min(path.stat().st_mtime for path in cached):
            for path in cached:
                path.unlink(missing_ok=True)


def prepare(dispatcher: Any, *arguments: Any) -> None:
    """Compile a `compiled` function for the types of these arguments before it is called. Raises
    `RuntimeError` with NUMBA_DISABLE_JIT.
    """
    if config.DISABLE_JIT:
        raise RuntimeError(
            "NUMBA_DISABLE_JIT is set: only the scalar formulas run without compilation"
        )
    dispatcher.compile(tuple(map(typeof, arguments)))


def _compile(dispatcher: Any, numba_compile: Callable[[Any], Any], types: Any) -> Any:
    """Compile a function for types of its arguments, or load it from the cache; return its entry
    point. One line on stderr announces each compilation. Of several processes one compiles, and the
    others load its files. Damaged files are removed; `OSError` is raised if that is not allowed.
    """
    if types in dispatcher.signatures:
        return numba_compile(types)
    folder = dispatcher.stats.cache_path
    code = dispatcher.py_func.__code__
    # What the names of the files of the function begin with.
    name = (
        folder and Path(folder) / f"{Path(code.co_filename).stem}.{dispatcher.py_func.__qualname__}"
    )
    with _one_thread, _alone(name):
        _remove_damaged(name)
        for found in (_files(name) != [], False):
            if not found:
                _announce(dispatcher, name)
            collects = gc.isenabled()
            # It would take a fifth of the time of a compilation.
            gc.disable()
            try:
                entry = numba_compile(types)
                _save_checksums(name)
                return entry
            except Exception:
                # Unpickling a damaged file can raise anything.
                if types in dispatcher.signatures:
                    # Compiled, but not saved: the disk is full or read-only.
                    return numba_compile(types)
                if not found:
                    raise
                _remove(name)
            finally:
                if collects:
                    gc.enable()


@contextmanager
def _alone(name: Path | None) -> Iterator[None]:
    """Wait until no other process prepares a function, where the system and the cache can tell."""
    with ExitStack() as stack:
        with suppress(ImportError, OSError):
            import fcntl

            if name is not None:
                lock = stack.enter_context(name.with_name(f"{name.name}.lock").open("w"))
                # Until the file is closed.
                fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def _files(name: Path | None) -> list[Path]:
    return [] if name is None else sorted(name.parent.glob(f"{name.name}-{PATTERN}"))


def _checksum(path: Path) -> str:
    """Return the line of a file in the file of checksums."""
    return f"{zlib.crc32(path.read_bytes()):08x} {path.name}"


def _remove_damaged(name: Path | None) -> None:
    """Remove all files of a function if they are not those of its checksums."""
    if name is None:
        return
    try:
        known = name.with_name(f"{name.name}.checksums").read_text(errors="replace").splitlines()
        damaged = known != [_checksum(path) for path in _files(name)]
    except OSError:
        # There are no checksums, or a file cannot be read.
        damaged = True
    if damaged:
        _remove(name)


def _save_checksums(name: Path | None) -> None:
    """Write the checksums of the files of a function, unless the folder is not writable."""
    text = "".join(f"{_checksum(path)}\n" for path in _files(name))
    with suppress(OSError):
        if name is not None and text:
            part = name.with_name(f"{name.name}.{os.getpid()}")
            part.write_text(text)
            part.replace(name.with_name(f"{name.name}.checksums"))


def _remove(name: Path | None) -> None:
    """Remove the files of a function. Raises `OSError` if that is not allowed."""
    try:
        for path in _files(name):
            path.unlink(missing_ok=True)
    except OSError:
        raise OSError(
            f"the compilation cache {name} is damaged: remove it, or set NUMBA_CACHE_DIR"
        ) from None


def _announce(dispatcher: Any, name: Path | None) -> None:
    """Say which function is compiled, how many are to be expected, and whether later processes
    load it.
    """
    kept = name is not None and os.access(name.parent, os.W_OK)
    until = (
        "kept for the next runs"
        if kept
        else "not kept, as no cache can be written: set NUMBA_CACHE_DIR"
    )
    function = f"{dispatcher.__module__.rpartition('.')[2]}.{dispatcher.__name__}"
    number = f"number {next(_number)}; most commands need 1 to 5"
    print(f"HybridTrack: compiling {function} ({number}), up to 15 s, {until}", file=sys.stderr)
