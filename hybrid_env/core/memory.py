"""Memory of the kernel arrays: aligned allocation, huge pages, and access by address."""

import math
import mmap
from contextlib import suppress
from typing import Any

import numpy as np
from numba import carray, types
from numba.extending import intrinsic
from numpy.typing import NDArray

from hybrid_env.core.compilation import inlined

CACHE_LINE = 64  # bytes
HUGE_PAGE = 1 << 21  # bytes


def aligned_zeros(shape: tuple[int, ...], dtype: Any) -> NDArray[Any]:
    """Return an array of zeros aligned to a cache line, so that the eight lanes of a field fill one line.

    A step accesses the state of all tracks once. With pages of 4 kB the translation lookaside buffer misses
    every few tracks, which takes longer than the computation. Large arrays therefore request huge pages.
    """
    kind = np.dtype(dtype)
    size = math.prod(shape) * kind.itemsize
    memory: NDArray[np.uint8]
    line = CACHE_LINE
    if size >= HUGE_PAGE // 2 and hasattr(mmap, "MADV_HUGEPAGE"):
        line = HUGE_PAGE
        # private mapping: a forked process gets a copy, and huge pages require it
        pages = mmap.mmap(-1, size + 2 * HUGE_PAGE, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
        with suppress(OSError):  # the system has no huge pages
            pages.madvise(mmap.MADV_HUGEPAGE)
        memory = np.frombuffer(pages, np.uint8)
    else:
        memory = np.zeros(size + CACHE_LINE, np.uint8)
    start = -memory.ctypes.data % line
    return memory[start : start + size].view(kind).reshape(shape)


def _inttoptr(_typing: Any, address: Any) -> Any:

    def build(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], context.get_value_type(types.voidptr))

    return types.voidptr(address), build


_pointer_to: Any = intrinsic(_inttoptr)
"""Convert an integer to a pointer for `numba.carray`."""


@inlined
def array_at(address: int, shape: tuple[int, ...], dtype: Any) -> Any:
    """Return the C-ordered array at an address; for compiled code only."""
    return carray(_pointer_to(address), shape, dtype)
