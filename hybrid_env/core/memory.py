"""Memory of the kernel's arrays: aligned allocation, large pages, and access by address."""

import math
import mmap
from contextlib import suppress
from typing import Any

import numpy as np
from numba import carray, types
from numba.extending import intrinsic
from numpy.typing import NDArray

from hybrid_env.core.compilation import internal

CACHE_LINE = 64  # bytes
LARGE_PAGE = 1 << 21  # bytes


def aligned_zeros(shape: tuple[int, ...], dtype: Any) -> NDArray[Any]:
    """Zeros that begin on a cache line, so that eight lanes of a field fill exactly one.

    A step walks through the state of all tracks once. With pages of 4 kB the address cache misses every few
    tracks, which takes longer than the tracks themselves, so large arrays ask for large pages.
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


def _inttoptr(_typing: Any, address: Any) -> Any:

    def build(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], context.get_value_type(types.voidptr))

    return types.voidptr(address), build


_pointer_to: Any = intrinsic(_inttoptr)
"""An integer as a pointer, which `numba.carray` asks for."""


@internal
def array_at(address: int, shape: tuple[int, ...], dtype: Any) -> Any:
    """The C-ordered array of a shape and dtype that begins at an address; for compiled code."""
    return carray(_pointer_to(address), shape, dtype)
