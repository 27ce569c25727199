"""What takes an instruction or a few, where numba would compile a function or cover every case."""

from typing import Any

from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, lower_builtin, models, register_model


def _reinterpret(_typing: Any, number: Any) -> Any:
    other = types.int64 if isinstance(number, types.Float) else types.float64

    def build(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        return builder.bitcast(arguments[0], context.get_value_type(other))

    return other(number), build


reinterpret: Any = intrinsic(_reinterpret)
"""The int64 with the bits of a float64, or the float64 with those of a 64-bit integer."""


def _chooses(sign: str) -> Any:
    def typed(_typing: Any, first: Any, second: Any) -> Any:
        floats = isinstance(first, types.Float) or isinstance(second, types.Float)
        kind = types.float64 if floats else types.int64

        def build(_context: Any, builder: Any, _: Any, arguments: Any) -> Any:
            compare = builder.fcmp_ordered if kind is types.float64 else builder.icmp_signed
            return builder.select(compare(sign, arguments[1], arguments[0]), arguments[1], arguments[0])

        return kind(kind, kind), build

    return typed


larger: Any = intrinsic(_chooses(">"))
"""max(first, second) of numbers, without a branch."""

smaller: Any = intrinsic(_chooses("<"))
"""min(first, second), likewise."""


class _Span(types.SimpleIteratorType):
    pass


SPAN = _Span("Span", types.intp)


@register_model(_Span)
class _SpanModel(models.StructModel):
    def __init__(self, manager: Any, span_type: _Span):
        super().__init__(manager, span_type, [("next", types.CPointer(types.intp)), ("last", types.intp)])


def _span(_typing: Any, _first: Any, _last: Any) -> Any:
    def build(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        coming = cgutils.alloca_once_value(builder, arguments[0])
        made = builder.insert_value(context.get_constant_undef(SPAN), coming, 0)
        return builder.insert_value(made, arguments[1], 1)

    return SPAN(types.intp, types.intp), build


span: Any = intrinsic(_span)
"""range(first, last), which counts up by one and cannot fail: a tenth of what range is before LLVM."""


@lower_builtin("iternext", _Span)
def _advance_span(context: Any, builder: Any, call: Any, arguments: Any) -> Any:
    coming, last = (builder.extract_value(arguments[0], k) for k in range(2))
    number = builder.load(coming)
    builder.store(builder.add(number, number.type(1), flags=["nsw"]), coming)
    pair = builder.insert_value(context.get_constant_undef(call.return_type), number, 0)
    return builder.insert_value(pair, builder.icmp_signed("<", number, last), 1)
