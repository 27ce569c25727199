"""How the kernel's functions are compiled: small pieces, in which loops over lanes become SIMD code.

NumPy's error model lets a division stand in such a loop without the branch that would raise.
"""

import functools
import gc
from typing import Any

from llvmlite import ir
from numba import njit, types
from numba.core import cgutils
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.extending import intrinsic, overload
from numba.np.arrayobj import make_array, populate_array

from hybrid_env.memory import CACHE_LINE


class _Ingredient(JITCodeLibrary):
    """Code that is only ever linked into that of callers: neither optimised as a module nor made executable.

    numba would do both for every function, which takes most of the time of a first start.
    """

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        self._ensure_finalized()
        return 0

    @property
    def codegen(self) -> Any:
        return self

    def set_env(self, name: str, environment: Any) -> None:
        pass


class _Internal(Compiler):
    def __init__(self, typing: Any, target: Any, library: Any, *rest: Any):
        super().__init__(typing, target, _Ingredient(target.codegen(), "internal"), *rest)


class _Outermost(Compiler):
    """Compiles a function and all that it calls without collecting garbage: a seventh of the time."""

    def compile_extra(self, func: Any) -> Any:
        collects = gc.isenabled()
        gc.disable()
        try:
            return super().compile_extra(func)
        finally:
            if collects:
                gc.enable()


_options: Any = {
    "error_model": "numpy",
    "_nrt": False,  # nothing is allocated: counting references would take a quarter of a step
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
    "pipeline_class": _Internal,
}

internal = njit(**_options)
"""A function for compiled code, and on disk a part of its caller; Python must not call it."""

formula = njit(forceinline=True, **_options)
"""An internal function that becomes part of the loop it stands in."""

internal_overload: Any = functools.partial(overload, jit_options=_options)
"""Chooses an internal function by the types of its arguments, see `numba.extending.overload`."""

compiled = njit(error_model="numpy", cache=True, pipeline_class=_Outermost)
"""A function that Python calls; kept on disk."""


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
