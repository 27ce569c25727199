"""Keeps numba's cache on disk honest.

numba checks a cached function against the file that it stands in, not against the files whose functions were
compiled into it, so after a change of `motion.py` an old `kernel.py` would go on silently.
"""

from contextlib import suppress
from pathlib import Path


def drop_stale_cache(package: Path, *imported: Path) -> None:
    """Remove a package's cached functions if any source is newer than the oldest of them.

    Args:
        package: folder with the package's modules and its __pycache__.
        imported: folders whose functions are compiled into the package's.
    """
    cached = list((package / "__pycache__").glob("*.nb[ic]"))
    if not cached:
        return
    with suppress(OSError):  # another process may be at the same work, or the folder be read-only
        newest = max(
            source.stat().st_mtime for folder in (package, *imported) for source in folder.glob("*.py")
        )
        if newest > min(path.stat().st_mtime for path in cached):
            for path in cached:
                path.unlink(missing_ok=True)
