"""Keeps numba's cache on disk honest.

numba checks a cached function against the file that it stands in, not against the files whose functions were
compiled into it, so after a change of `motion.py` an old `kernel.py` would go on silently.
"""

from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path


def drop_stale_cache(cache: str | Path | None, packages: Iterable[Path]) -> None:
    """Remove cached functions if any source is newer than the oldest of them.

    Args:
        cache: where numba keeps them, `stats.cache_path` of a compiled function; None where it keeps none.
        packages: folders of the sources that may be part of them.
    """
    cached = [] if cache is None else list(Path(cache).glob("*.nb[ic]"))
    if not cached:
        return
    with suppress(OSError):  # another process may be at the same work, or the folder be read-only
        newest = max(source.stat().st_mtime for folder in packages for source in folder.glob("*.py"))
        if newest > min(path.stat().st_mtime for path in cached):
            for path in cached:
                path.unlink(missing_ok=True)
