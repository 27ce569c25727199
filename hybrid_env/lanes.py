"""Records of lanes: every field holds the number of each track of a block, side by side.

So a loop over lanes has a fixed length and constant strides, and becomes SIMD code. Compiled code reads a
record through `by_lane`: an access is then one load or store at a known place, where numba would make an
array of the field first, and ask of every index whether it counts from the end.
"""

import operator
import zlib
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.imputils import lower_getattr_generic
from numba.core.typing.templates import AbstractTemplate, AttributeTemplate, infer_global, signature
from numba.extending import infer_getattr, intrinsic, lower_builtin, models, register_model

LANES = 8
"""Tracks of a block: eight float64 fill a cache line and the widest vector register."""


def lanes_of(*fields: tuple[str, type, tuple[int, ...]]) -> np.dtype[Any]:
    """A record whose fields hold an array of a shape for each lane, lanes innermost."""
    return np.dtype([(name, kind, (*shape, LANES)) for name, kind, shape in fields])


class _ByLane(types.Type):
    """Where a record lies."""

    def __init__(self, record: types.Record):
        self.record = record
        super().__init__(f"ByLane({zlib.crc32(repr(record).encode()):08x})")  # it is part of many symbols

    @property
    def key(self) -> Any:
        return self.record


class _Field(types.Type):
    """Where a field of a record lies."""

    def __init__(self, dtype: types.Type, shape: tuple[int, ...]):
        self.dtype, self.shape = dtype, shape
        super().__init__(f"Field({dtype}, {shape})")


register_model(_ByLane)(models.OpaqueModel)
register_model(_Field)(models.OpaqueModel)


def _by_lane(_typing: Any, record: Any) -> Any:
    def build(_context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        return builder.bitcast(arguments[0], cgutils.voidptr_t)

    return _ByLane(record)(record), build


by_lane: Any = intrinsic(_by_lane)
"""A record whose fields are read and written as `record.field[lane]` and `record.field[k, lane]`.

Indices are not checked, and must not be negative.
"""


@infer_getattr
class _FieldOfRecord(AttributeTemplate):
    key = _ByLane

    def generic_resolve(self, lanes: Any, name: str) -> Any:  # type: ignore[override]
        if name in lanes.record.fields:
            field = lanes.record.typeof(name)
            return _Field(field.dtype, field.shape)
        return None


@lower_getattr_generic(_ByLane)
def _find(context: Any, builder: Any, lanes: Any, record: Any, name: str) -> Any:
    return builder.gep(record, [ir.IntType(64)(lanes.record.offset(name))])


@infer_global(operator.getitem)
class _Load(AbstractTemplate):
    def generic(self, arguments: Any, _: Any) -> Any:
        field, index = arguments
        return signature(field.dtype, field, index) if isinstance(field, _Field) else None


@infer_global(operator.setitem)
class _Store(AbstractTemplate):
    def generic(self, arguments: Any, _: Any) -> Any:
        field, index, _value = arguments
        return signature(types.none, field, index, field.dtype) if isinstance(field, _Field) else None


def _element(context: Any, builder: Any, field: Any, start: Any, kind: Any, index: Any) -> Any:
    """Pointer to what an index, a number or a tuple of them, stands for."""
    several = isinstance(kind, types.BaseTuple)
    indices = cgutils.unpack_tuple(builder, index) if several else [index]
    flat = ir.IntType(64)(0)
    for extent, each, integer in zip(field.shape, indices, kind if several else [kind], strict=True):
        number = context.cast(builder, each, integer, types.intp)
        flat = builder.add(builder.mul(flat, ir.IntType(64)(extent)), number)
    element = context.get_data_type(field.dtype).as_pointer()
    return builder.gep(builder.bitcast(start, element), [flat])


@lower_builtin(operator.getitem, _Field, types.Any)
def _load(context: Any, builder: Any, call: Any, arguments: Any) -> Any:
    place = _element(context, builder, call.args[0], arguments[0], call.args[1], arguments[1])
    return builder.load(place)


@lower_builtin(operator.setitem, _Field, types.Any, types.Any)
def _store(context: Any, builder: Any, call: Any, arguments: Any) -> Any:
    place = _element(context, builder, call.args[0], arguments[0], call.args[1], arguments[1])
    builder.store(arguments[2], place)
    return context.get_dummy_value()
