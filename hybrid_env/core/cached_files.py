"""The files in which numba caches compiled functions: outdated and damaged ones are removed.

numba compares a cached function with the file that defines it, but not with the files of its callees, so that
after a change of `motion.py` it would use an outdated kernel without notice. It has no checksums either: a
damaged file would be executed as machine code. numba's public interface has no hook for either, therefore
this file knows the names of its cache files, `<file>.<function>-*.nbi` and `.nbc` in the folder
`stats.cache_path` of a function. If these names change, nothing is found, and nothing is removed.
"""

import functools
import os
import sys
import zlib
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


class CachedFiles:
    """The files of one function, and their checksums in one more file."""

    def __init__(self, dispatcher: Any):
        folder = dispatcher.stats.cache_path
        self._folder = None if folder is None else Path(folder)
        code = dispatcher.py_func.__code__
        self._name = f"{Path(code.co_filename).stem}.{dispatcher.py_func.__qualname__}"

    def paths(self) -> list[Path]:
        """Return the files."""
        return [] if self._folder is None else sorted(self._folder.glob(f"{self._name}-{PATTERN}"))

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
                f"the compilation cache {self._folder} is damaged: remove it, or set NUMBA_CACHE_DIR"
            ) from None

    def _checksums(self) -> Path:
        assert self._folder is not None
        return self._folder / f"{self._name}.checksums"


def _checksum(path: Path) -> str:
    """Return the line of a file in the file of checksums."""
    return f"{zlib.crc32(path.read_bytes()):08x} {path.name}"
