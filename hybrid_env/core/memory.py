"""Memory of the kernel's arrays: on cache lines, and in large pages where it is large."""

import math
import mmap
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

CACHE_LINE = 64  # bytes
LARGE_PAGE = 1 << 21  # bytes


def aligned_zeros(shape: tuple[int, ...], dtype: Any) -> NDArray[Any]:
    """Zeros that begin on a cache line, so that eight lanes of a field fill exactly one.

    A step walks through the state of all tracks once. With pages of 4 kB that is a miss of the address cache
    every few tracks, which takes longer than the tracks, so arrays of many tracks ask for large pages.
    """
    kind = np.dtype(dtype)
    size = math.prod(shape) * kind.itemsize
    memory: NDArray[np.uint8]
    line = CACHE_LINE
    if size >= LARGE_PAGE // 2 and hasattr(mmap, "MADV_HUGEPAGE"):
        line = LARGE_PAGE
        # private: a forked process has its own tracks, and only such memory gets large pages
        pages = mmap.mmap(-1, size + 2 * LARGE_PAGE, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
        with suppress(OSError):  # a system without them
            pages.madvise(mmap.MADV_HUGEPAGE)
        memory = np.frombuffer(pages, np.uint8)
    else:
        memory = np.zeros(size + CACHE_LINE, np.uint8)
    start = -memory.ctypes.data % line
    return memory[start : start + size].view(kind).reshape(shape)
