"""Arrays that are declared once: allocated from Python, and found by their addresses in compiled
code. A named tuple of arrays declares each of them by `Annotated[NDArray[...], Array(dtype,
sizes)]`. A size is a number or a field of the parameter record; the address is in the field with
the name of the array.
"""

import math
import mmap
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numba import carray, types
from numba.extending import intrinsic
from numpy.typing import NDArray

from hybrid_env.core.compilation import inlined, internal

FloatArray = NDArray[np.float64]
Records = NDArray[Any]
Owner = Literal["tracks", "options", "thread"]

# Bytes.
CACHE_LINE = 64
# Bytes.
HUGE_PAGE = 1 << 21


@dataclass(frozen=True)
class Array:
    """The declaration of an array: its type, and its shape as numbers or fields of the parameter
    record.
    """

    dtype: Any
    sizes: tuple[int | str, ...]
    # Whose state it holds; "options" do not change, "thread" is temporary, shared by its blocks.
    of: Owner = "tracks"
    # Field with its address, if that is not its name: another view of the same memory.
    at: str = ""


def declared(arrays: type, *owners: Owner) -> dict[str, Array]:
    """Return the declarations of a named tuple by name, of all owners or of some; views are left
    out.
    """
    found = {name: one.__metadata__[0] for name, one in arrays.__annotations__.items()}
    return {
        name: one for name, one in found.items() if not one.at and (not owners or one.of in owners)
    }


def aligned_zeros(shape: tuple[int, ...], dtype: Any) -> NDArray[Any]:
    """Return an array of zeros aligned to a cache line, so that the eight lanes of a field fill one
    line. Large arrays request huge pages: with pages of 4 kB the address cache misses every few
    tracks, which takes longer than the computation.
    """
    kind = np.dtype(dtype)
    size = math.prod(shape) * kind.itemsize
    memory: NDArray[np.uint8]
    line = CACHE_LINE
    if size >= HUGE_PAGE // 2 and hasattr(mmap, "MADV_HUGEPAGE"):
        line = HUGE_PAGE
        # Private mapping: a forked process gets a copy, and huge pages require it.
        pages = mmap.mmap(-1, size + 2 * HUGE_PAGE, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
        # The system has no huge pages.
        with suppress(OSError):
            pages.madvise(mmap.MADV_HUGEPAGE)
        memory = np.frombuffer(pages, np.uint8)
    else:
        memory = np.zeros(size + CACHE_LINE, np.uint8)
    start = -memory.ctypes.data % line
    return memory[start : start + size].view(kind).reshape(shape)


def allocate(one: Array, sizes: Mapping[str, int] | np.void) -> NDArray[Any]:
    """Return an array of zeros with the declared type and shape."""
    shape = tuple(size if isinstance(size, int) else int(sizes[size]) for size in one.sizes)
    return aligned_zeros(shape, one.dtype)


def _inttoptr(_typing: Any, address: Any) -> Any:

    def build(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], context.get_value_type(types.voidptr))

    return types.voidptr(address), build


# Convert an integer to a pointer for `numba.carray`.
_pointer_to: Any = intrinsic(_inttoptr)


@inlined
def array_at(address: int, shape: tuple[int, ...], dtype: Any) -> Any:
    """Return the C-ordered array at an address; for compiled code only."""
    return carray(_pointer_to(address), shape, dtype)


# In compiled code a tuple of different types is built by a tree of functions, with one leaf for
# each element.


def _size_reader(size: int | str) -> Any:
    if isinstance(size, str):
        return inlined(lambda setting: setting[size])
    return inlined(lambda setting: size)


def _tuple_reader(readers: list[Any]) -> Any:
    """Return the compiled function of the tuple of the values of compiled functions of one
    argument.
    """
    if len(readers) == 1:
        one = readers[0]
        return inlined(lambda source: (one(source),))
    if len(readers) == 2:
        one, two = readers
        return inlined(lambda source: (one(source), two(source)))
    half = len(readers) // 2
    first = _tuple_reader(readers[:half])
    second = _tuple_reader(readers[half:])
    return inlined(lambda source: first(source) + second(source))


def _array_reader(name: str, one: Array) -> Any:
    address, dtype = one.at or name, one.dtype
    shape = _tuple_reader([_size_reader(size) for size in one.sizes])
    return inlined(lambda setting: array_at(setting[address], shape(setting), dtype))


def reader(arrays: type) -> Callable[[Any], Any]:
    """Return the compiled function that finds the arrays of a named tuple by a parameter record."""
    found = {name: one.__metadata__[0] for name, one in arrays.__annotations__.items()}
    values = _tuple_reader([_array_reader(name, one) for name, one in found.items()])
    read: Callable[[Any], Any] = inlined(lambda setting: arrays(*values(setting)))
    return read


def block_reader(bank: type) -> Callable[[Any, int], Any]:
    """Return the compiled function of the bank of one block, from the banks of all blocks."""

    def of_block(k: int, one: Array) -> Any:
        if one.of == "tracks":
            return inlined(lambda source: source[0][k][source[1]])
        return inlined(lambda source: source[0][k])

    values = _tuple_reader([of_block(k, one) for k, one in enumerate(declared(bank).values())])
    read: Callable[[Any, int], Any] = internal(lambda banks, block: bank(*values((banks, block))))
    return read
