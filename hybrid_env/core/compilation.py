"""Compilation: numba's `njit` with common options, and the folder of its cache.

With NumPy's error model a division has no branch that raises, so that loops over lanes compile to
SIMD code. Without the GIL threads step different tracks in parallel. With NUMBA_BOUNDSCHECK=1 every
index is checked. numba compares a cached function with the file that defines it, but not with those
of its callees: the name of the folder is a hash of the sources that a function may call.
"""

import ast
import functools
import gc
import hashlib
import os
import stat
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numba
from numba import njit, typeof
from numba import types as numba_types
from numba.extending import intrinsic as numba_intrinsic
from numba.extending import overload, register_jitable

try:
    import fcntl
except ImportError:
    # Not on Windows, where two processes may compile the same function.
    fcntl: Any = None  # type: ignore[no-redef]

# Filled at run time.
config: Any = numba.config

COMPILING = "HYBRIDTRACK_COMPILING"
"""Environment variable of processes that need not say that they compile: another one has."""

OPTIONS: Any = {"error_model": "numpy", "nogil": True, "no_cfunc_wrapper": True}
"""Options of all functions. C never calls one."""

inlined: Any = njit(**OPTIONS, inline="always")
"""Decorator of a part of a function with one or two callers, which numba inlines before it infers
types: its statements are compiled again at every call.
"""

intrinsic: Any = numba_intrinsic
"""Decorator of a function that writes the instructions for compiled callers. Its first argument is
not the callers'.
"""

internal: Any = register_jitable(**OPTIONS, forceinline=True)
"""Decorator of a function that is compiled when a compiled function calls it, once for all calls
with the same types, and which LLVM inlines: by itself it does not where there are two callers.
Python runs it as it is.
"""

apart: Any = register_jitable(**OPTIONS, forceinline=False)
"""The same for a function that begins with `stay_apart()`: few environments call it, many places
do, or it is long. The rest compiles faster without it, and to better code. It takes few arguments,
as an array is passed as seven numbers or more.
"""


@intrinsic
def stay_apart(_typing: Any) -> Any:
    """Do nothing, but LLVM does not inline the function that calls this."""

    def build(context: Any, builder: Any, _signature: Any, _arguments: Any) -> Any:
        builder.function.attributes.add("noinline")
        return context.get_dummy_value()

    return numba_types.void(), build


summing: Any = register_jitable(**OPTIONS, fastmath={"reassoc"})
"""The same for a function whose sums may be taken in any order, so that they become SIMD code.
Their rounding depends on the processor: not for environments and banks.
"""


def selected(choose: Callable[[Any], Any]) -> Any:
    """Return a function for compiled code. choose: the function that is called, by numba's type of
    the first argument.
    """

    def operation(first: Any, *arguments: Any) -> Any:
        raise NotImplementedError("compiled code only")

    # Not strict: the names of the arguments may differ.
    @overload(operation, jit_options=OPTIONS, strict=False)
    def select(first, *arguments):  # type: ignore[no-untyped-def]
        return choose(first)

    return operation


def compiled(function: Callable[..., Any]) -> Any:
    """Decorator of a function called from Python. Its machine code is cached on disk: it is
    compiled or loaded at its first call, or by `prepare`.
    """
    if config.DISABLE_JIT:
        return function
    given = config.CACHE_DIR
    folder = cache_folder(function.__code__.co_filename, function.__module__)
    try:
        config.CACHE_DIR = folder
        return njit(**OPTIONS, cache=bool(folder))(function)
    finally:
        config.CACHE_DIR = given


@functools.cache
def _imports(path: Path, root: Path, package: str) -> list[Path]:
    """Return the files of a package, whose folder is in `root`, that one of its files imports."""
    found: list[Path] = []
    for node in ast.walk(ast.parse(path.read_bytes())):
        if not isinstance(node, ast.ImportFrom):
            continue
        module = node.module or ""
        if node.level or module.startswith(f"{package}."):
            base = path.parents[node.level - 1] if node.level else root
            names = module, *(f"{module}.{alias.name}" for alias in node.names)
            found += (base / f"{name.strip('.').replace('.', '/')}.py" for name in names)
    return [other for other in found if other.is_file()]


@functools.cache
def cache_folder(file: str, module: str) -> str:
    """Return the folder for the machine code of a module, "" where none can be written: in
    NUMBA_CACHE_DIR or else in the user's cache folder, or in the temporary folder. Its name is a
    hash of the sources of the core, of the module and of what it imports from its package, of
    numba's version and of what is checked. Nobody but the user may write to it, because machine
    code is loaded from it, and the present folder does not name it: numba's own setting may come
    from a file there.

    Args:
        file: with the source of the module.
        module: its full name.
    """
    code = hashlib.sha256(f"{numba.__version__} {config.BOUNDSCHECK}".encode())
    sources = set(Path(__file__).parent.rglob("*.py"))
    # The other files of this package call the core only; numba compares them itself.
    package = module.partition(".")[0]
    if package != __name__.partition(".")[0]:
        root = Path(file).parents[module.count(".")]
        new = [Path(file)]
        while new:
            path = new.pop()
            if path not in sources:
                sources.add(path)
                new += _imports(path, root, package)
    for path in sorted(sources):
        code.update(path.read_bytes())
    name = f"hybridtrack-{code.hexdigest()[:16]}"
    # Without users there are no modes.
    user, writers = (os.getuid(), 0o022) if hasattr(os, "getuid") else (0, 0)
    named = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME")
    for parent in (named or "~/.cache", tempfile.gettempdir()):
        # Also without a home.
        with suppress(OSError, RuntimeError):
            folder = Path(parent, f"{name}-{user}").expanduser()
            if folder.is_absolute():
                folder.mkdir(mode=0o700, parents=True, exist_ok=True)
                status = folder.lstat()
                own = stat.S_ISDIR(status.st_mode) and status.st_uid == user
                if own and not status.st_mode & writers:
                    tempfile.TemporaryFile(dir=folder).close()
                    return str(folder)
            _say_refused(parent)
    return ""


def _announce(kept: str) -> None:
    """Say once that functions are compiled: not in every process that a command starts."""
    if not os.environ.get(COMPILING):
        os.environ[COMPILING] = "said"
        words = f"compiling, for minutes the first time; code is {kept}"
        print(f"HybridTrack: {words}", file=sys.stderr)


@functools.cache
def _say_refused(parent: str) -> None:
    print(
        f"HybridTrack: no compiled code is kept in {parent}:"
        " expected the full path of a folder that nobody else may write",
        file=sys.stderr,
    )


def prepare(dispatcher: Any, *arguments: Any, announced: bool = True) -> None:
    """Compile a `compiled` function for the types of these arguments before it is called, or load
    it. One line on stderr announces the first compilation of a process. Files that cannot be loaded
    are replaced. Raises `RuntimeError` with NUMBA_DISABLE_JIT.
    """
    if config.DISABLE_JIT:
        raise RuntimeError(
            "NUMBA_DISABLE_JIT is set: only the scalar formulas run without compilation"
        )
    types = tuple(map(typeof, arguments))
    if types in dispatcher.signatures:
        return
    folder, name = dispatcher.stats.cache_path, dispatcher.__name__
    collects = gc.isenabled()
    # It would take a fifth of the time of a compilation.
    gc.disable()
    try:
        with _alone(folder, name):
            _compile(dispatcher, types, folder, name, announced)
    finally:
        if collects:
            gc.enable()


@contextmanager
def _alone(folder: str, name: str) -> Iterator[None]:
    """Wait until no other process compiles a function into a folder: what it has compiled is then
    loaded.
    """
    if not folder or fcntl is None:
        yield
        return
    Path(folder).mkdir(parents=True, exist_ok=True)
    with Path(folder, f"{name}.lock").open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


def _compile(
    dispatcher: Any, types: tuple[Any, ...], folder: str, name: str, announced: bool
) -> None:
    """Compile or load a function, see `prepare`; `folder` is "" where nothing is kept."""
    files = list(Path(folder).glob(f"*.{name}-*.nb?")) if folder else []
    if announced and not files:
        _announce("kept" if folder else "not kept: set NUMBA_CACHE_DIR")
    try:
        dispatcher.compile(types)
    except Exception as error:
        if not files:
            raise
        for file in files:
            file.unlink(missing_ok=True)
        reason = f"{name} in {folder} is damaged ({type(error).__name__})"
        print(f"HybridTrack: {reason}: compiling it again, up to 30 s", file=sys.stderr)
        dispatcher.compile(types)
