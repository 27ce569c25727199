"""Records and arrays where they lie in memory: in compiled code, an access is one load or store.

For `record.field[lane]` numba makes an array of the field, then asks whether the index counts from the end;
an array is nine numbers to every function that it is given to. LLVM removes that again, but it was three in
five of all instructions and a third of a first start. Here a record is its address, an array, C-ordered, its
address and extents. Indices must not be negative; only those known to the compiler are checked.
"""

import operator
import zlib
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.errors import TypingError
from numba.core.typing.templates import AbstractTemplate, AttributeTemplate, infer_global, signature
from numba.extending import (
    infer_getattr,
    intrinsic,
    lower_builtin,
    lower_getattr_generic,
    models,
    register_model,
)
from numba.np.numpy_support import as_dtype

from hybrid_env.core.memory import CACHE_LINE

WORD = ir.IntType(64)


class _Record(types.Type):
    """A record in place."""

    def __init__(self, record: types.Record):
        self.record = record
        super().__init__(f"InPlace({zlib.crc32(repr(record).encode()):08x})")  # short: symbols contain it

    @property
    def key(self) -> Any:
        return self.record


class _Array(types.Type):
    """An array in place. Extents: those of a field, or all None where only the program knows them."""

    def __init__(self, dtype: types.Type, extents: tuple[int | None, ...]):
        self.dtype, self.extents = dtype, extents
        self.itemsize = as_dtype(dtype).itemsize
        self.element = _Record(dtype) if isinstance(dtype, types.Record) else dtype
        super().__init__(f"InPlace({self.element}, {extents})")

    @property
    def key(self) -> Any:
        return self.dtype, self.extents


register_model(_Record)(models.OpaqueModel)


@register_model(_Array)
def _model(manager: Any, array: _Array) -> Any:
    if None not in array.extents:
        return models.OpaqueModel(manager, array)
    extents = [(f"extent{k}", types.intp) for k in range(len(array.extents))]
    return models.StructModel(manager, array, [("start", types.voidptr), *extents])


def _numbers(index: Any) -> tuple[Any, ...]:
    """Types of an index, a number or a tuple of them."""
    return tuple(index) if isinstance(index, types.Tuple | types.UniTuple) else (index,)


def _are_integers(index: Any) -> bool:
    """Whether an index or a shape is an integer or a tuple of them."""
    numbers = _numbers(index)
    return bool(numbers) and all(isinstance(number, types.Integer) for number in numbers)


def _make(context: Any, builder: Any, array: _Array, start: Any, extents: Any) -> Any:
    if None not in array.extents:
        return start
    made = builder.insert_value(ir.Constant(context.get_value_type(array), ir.Undefined), start, 0)
    for position, extent in enumerate(extents, 1):
        made = builder.insert_value(made, extent, position)
    return made


def _open(builder: Any, array: _Array, value: Any) -> tuple[Any, list[Any]]:
    """Address and extents of an array."""
    if None not in array.extents:
        return value, [WORD(extent) for extent in array.extents]
    start, *extents = (builder.extract_value(value, k) for k in range(1 + len(array.extents)))
    return start, extents


def _in_place(_typing: Any, record: Any) -> Any:
    if not isinstance(record, _Record | types.Record):
        return None

    def build(_context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        return builder.bitcast(arguments[0], cgutils.voidptr_t)

    return (record if isinstance(record, _Record) else _Record(record))(record), build


in_place: Any = intrinsic(_in_place)
"""A record where it lies: `record.field` is a number or an array in place.

It may be one of NumPy's array or in place already, so that code that begins with this takes either.
"""


def _array_at(_typing: Any, address: Any, shape: Any, dtype: Any) -> Any:
    if not isinstance(address, types.Integer) or not _are_integers(shape):
        return None
    array = _Array(dtype.dtype, (None,) * len(shape))

    def build(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        extents = [
            context.cast(builder, extent, kind, types.intp)
            for extent, kind in zip(cgutils.unpack_tuple(builder, arguments[1]), shape, strict=True)
        ]
        start = builder.inttoptr(arguments[0], cgutils.voidptr_t)
        return _make(context, builder, array, start, extents)

    return array(address, shape, dtype), build


array_at: Any = intrinsic(_array_at)
"""The array of a shape and dtype that begins at an address."""


def _prefetch(_typing: Any, place: Any, beyond: Any, dtype: Any) -> Any:
    if not isinstance(place, _Array | _Record) or not isinstance(beyond, types.Integer):
        return None
    size = as_dtype(dtype.dtype).itemsize

    def build(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        start = arguments[0]
        if isinstance(place, _Array):
            start, _extents = _open(builder, place, start)
        number = ir.IntType(32)
        kind = ir.FunctionType(ir.VoidType(), [cgutils.voidptr_t, number, number, number])
        function = builder.module.declare_intrinsic("llvm.prefetch", (cgutils.voidptr_t,), kind)
        to_write, keep, data = number(1), number(3), number(1)
        for offset in range(0, size, CACHE_LINE):
            line = builder.gep(start, [builder.add(arguments[1], WORD(offset))])
            builder.call(function, [line, to_write, keep, data])
        return context.get_dummy_value()

    return types.none(place, types.intp, dtype), build


prefetch: Any = intrinsic(_prefetch)
"""Ask for the element of a dtype that lies a number of bytes beyond the start of a record or an array.

It comes while others are at work. Nothing happens where there is no memory, so callers need not check for the
last element.
"""


@infer_getattr
class _Fields(AttributeTemplate):
    key = _Record

    def generic_resolve(self, place: Any, name: str) -> Any:  # type: ignore[override]
        if name not in place.record.fields:
            return None
        field = place.record.typeof(name)
        if not isinstance(field, types.NestedArray):
            return field
        alignment = as_dtype(field.dtype).alignment
        if place.record.offset(name) % alignment or place.record.size % alignment:
            raise TypingError(f"array {name} of a record is not aligned to {alignment} bytes")
        return _Array(field.dtype, field.shape)


@lower_getattr_generic(_Record)
def _field(context: Any, builder: Any, place: Any, record: Any, name: str) -> Any:
    field = place.record.typeof(name)
    start = builder.gep(record, [WORD(place.record.offset(name))])
    if isinstance(field, types.NestedArray):
        return _make(context, builder, _Array(field.dtype, field.shape), start, field.shape)
    pointer = builder.bitcast(start, context.get_data_type(field).as_pointer())
    return context.unpack_value(builder, field, pointer, align=1)  # records are packed


@infer_getattr
class _Extents(AttributeTemplate):
    key = _Array

    def resolve_shape(self, array: Any) -> Any:
        return types.UniTuple(types.intp, len(array.extents))

    def resolve_size(self, _array: Any) -> Any:
        return types.intp

    def resolve_nbytes(self, _array: Any) -> Any:
        return types.intp


@lower_getattr_generic(_Array)
def _extent(context: Any, builder: Any, array: Any, value: Any, name: str) -> Any:
    extents = _open(builder, array, value)[1]
    if name == "shape":
        return context.make_tuple(builder, types.UniTuple(types.intp, len(extents)), extents)
    product = WORD(array.itemsize) if name == "nbytes" else WORD(1)
    for extent in extents:
        product = builder.mul(product, extent)
    return product


def _found(array: Any, index: Any) -> Any:
    """Type of what an index stands for: an element, or an array if it leaves extents; None if it is none."""
    if not isinstance(array, _Array) or not _are_integers(index):
        return None
    numbers = _numbers(index)
    left = array.extents[len(numbers) :]
    if left:
        return _Array(array.dtype, left)
    return array.element if len(numbers) == len(array.extents) else None


def _position(context: Any, builder: Any, array: _Array, k: int, kind: Any, number: Any) -> Any:
    if not isinstance(kind, types.IntegerLiteral):
        return context.cast(builder, number, kind, types.intp)
    known, extent = kind.literal_value, array.extents[k]
    if known < 0 or (extent is not None and known >= extent):
        allowed = "0 or more" if extent is None else f"from 0 to {extent - 1}"
        raise TypingError(f"index {known} is not allowed: expected {allowed}")
    return WORD(known)


def _locate(context: Any, builder: Any, call: Any, arguments: Any) -> tuple[Any, list[Any]]:
    """Pointer to the first element that an index stands for, and all extents."""
    array, index = call.args[:2]
    start, extents = _open(builder, array, arguments[0])
    several = isinstance(index, types.BaseTuple)
    numbers = cgutils.unpack_tuple(builder, arguments[1]) if several else [arguments[1]]
    flat = None
    for k, extent in enumerate(extents):
        if flat is not None:
            flat = builder.mul(flat, extent)
        if k < len(numbers):
            number = _position(context, builder, array, k, _numbers(index)[k], numbers[k])
            flat = number if flat is None else builder.add(flat, number)
    element = context.get_data_type(array.dtype).as_pointer()
    return builder.gep(builder.bitcast(start, element), [flat]), extents


@infer_global(operator.getitem)
class _Item(AbstractTemplate):
    prefer_literal = True  # so that a known index is checked

    def generic(self, arguments: Any, _: Any) -> Any:
        array, index = arguments
        found = _found(array, index)
        return None if found is None else signature(found, array, index)


@lower_builtin(operator.getitem, _Array, types.Any)
def _load(context: Any, builder: Any, call: Any, arguments: Any) -> Any:
    place, extents = _locate(context, builder, call, arguments)
    found = call.return_type
    if not isinstance(found, _Array | _Record):
        return context.unpack_value(builder, found, place)
    start = builder.bitcast(place, cgutils.voidptr_t)
    if isinstance(found, _Record):
        return start
    return _make(context, builder, found, start, extents[-len(found.extents) :])


@infer_global(operator.setitem)
class _SetItem(AbstractTemplate):
    prefer_literal = True

    def generic(self, arguments: Any, _: Any) -> Any:
        array, index, _value = arguments
        found = _found(array, index)
        if found is None or isinstance(found, _Array | _Record):
            return None
        return signature(types.none, array, index, found)


@lower_builtin(operator.setitem, _Array, types.Any, types.Any)
def _store(context: Any, builder: Any, call: Any, arguments: Any) -> Any:
    place, _extents = _locate(context, builder, call, arguments)
    context.pack_value(builder, call.args[0].dtype, arguments[2], place)
    return context.get_dummy_value()
