"""What compiled code can say of memory and bits that Python cannot: a few instructions of the processor."""

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic
from numba.np.arrayobj import make_array, populate_array

from hybrid_env.memory import CACHE_LINE


def _array_at(_typing: Any, address: Any, shape: Any, dtype: Any) -> Any:
    array = types.Array(dtype.dtype, len(shape), "C")

    def build(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        made = make_array(array)(context, builder)
        extents = [
            context.cast(builder, extent, kind, types.intp)
            for extent, kind in zip(cgutils.unpack_tuple(builder, arguments[1]), shape, strict=True)
        ]
        size = context.get_constant(types.intp, context.get_abi_sizeof(context.get_data_type(array.dtype)))
        strides = [size]
        for extent in reversed(extents[1:]):
            strides.insert(0, builder.mul(strides[0], extent))
        data = builder.inttoptr(arguments[0], made.data.type)
        populate_array(made, data, extents, strides, size, None)
        return made._getvalue()

    return array(address, shape, dtype), build


array_at: Any = intrinsic(_array_at)
"""The array of a shape and dtype that begins at an address; `numba.carray` compiles slower."""


def _prefetch(_typing: Any, array: Any, index: Any, beyond: Any) -> Any:
    def build(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        number, word = ir.IntType(32), ir.IntType(64)
        kind = ir.FunctionType(ir.VoidType(), [cgutils.voidptr_t, number, number, number])
        function = builder.module.declare_intrinsic("llvm.prefetch", (cgutils.voidptr_t,), kind)
        to_write, keep, data = number(1), number(3), number(1)
        size = context.get_abi_sizeof(context.get_data_type(array.dtype))
        first = builder.ptrtoint(make_array(array)(context, builder, arguments[0]).data, word)
        start = builder.add(builder.add(first, builder.mul(arguments[1], word(size))), arguments[2])
        for offset in range(0, size, CACHE_LINE):
            line = builder.inttoptr(builder.add(start, word(offset)), cgutils.voidptr_t)
            builder.call(function, [line, to_write, keep, data])
        return cgutils.get_null_value(cgutils.voidptr_t)

    return types.voidptr(array, types.int64, types.int64), build


prefetch: Any = intrinsic(_prefetch)
"""Ask for what lies a number of bytes beyond an element of a C-ordered array, counted flat.

It comes while others are at work. Nothing happens where there is no memory, so callers need not check for the
last element.
"""


def _reinterpret(_typing: Any, number: Any) -> Any:
    other = types.int64 if isinstance(number, types.Float) else types.float64

    def build(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        return builder.bitcast(arguments[0], context.get_value_type(other))

    return other(number), build


reinterpret: Any = intrinsic(_reinterpret)
"""The int64 with the bits of a float64, or the float64 with those of a 64-bit integer."""


def _chooses(sign: str) -> Any:
    def typed(_typing: Any, first: Any, second: Any) -> Any:
        kind = types.float64 if isinstance(first, types.Float) else types.int64

        def build(_context: Any, builder: Any, _: Any, arguments: Any) -> Any:
            compare = builder.fcmp_ordered if kind is types.float64 else builder.icmp_signed
            return builder.select(compare(sign, arguments[1], arguments[0]), arguments[1], arguments[0])

        return kind(kind, kind), build

    return typed


larger: Any = intrinsic(_chooses(">"))
"""max(first, second) without a branch; numba compiles its own as a function."""

smaller: Any = intrinsic(_chooses("<"))
"""min(first, second), likewise."""
