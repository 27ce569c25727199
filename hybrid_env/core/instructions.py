"""What takes an instruction or a few, where numba would compile a function or cover every case."""

from typing import Any

from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, lower_builtin, models, register_model


def _reinterpret(_typing: Any, number: Any) -> Any:
    if number not in (types.float64, types.int64, types.uint64):
        return None
    other = types.int64 if isinstance(number, types.Float) else types.float64

    def build(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        return builder.bitcast(arguments[0], context.get_value_type(other))

    return other(number), build


reinterpret: Any = intrinsic(_reinterpret)
"""The int64 with the bits of a float64, or the float64 with those of a 64-bit integer."""


def _chooses(sign: str) -> Any:
    def typed(_typing: Any, first: Any, second: Any) -> Any:
        kinds = (first, second)
        if not all(isinstance(each, types.Float) or each in types.signed_domain for each in kinds):
            return None
        kind = types.float64 if any(isinstance(each, types.Float) for each in kinds) else types.int64

        def build(_context: Any, builder: Any, _: Any, arguments: Any) -> Any:
            compare = builder.fcmp_ordered if kind is types.float64 else builder.icmp_signed
            return builder.select(compare(sign, arguments[1], arguments[0]), arguments[1], arguments[0])

        return kind(kind, kind), build

    return typed


larger: Any = intrinsic(_chooses(">"))
"""max(first, second) of floats or signed integers, without a branch."""

smaller: Any = intrinsic(_chooses("<"))
"""min(first, second), likewise."""


class _Span(types.SimpleIteratorType):
    pass


SPAN = _Span("Span", types.intp)


@register_model(_Span)
class _SpanModel(models.StructModel):
    def __init__(self, manager: Any, span_type: _Span):
        super().__init__(
            manager, span_type, [("next", types.EphemeralPointer(types.intp)), ("last", types.intp)]
        )


def _span(_typing: Any, first: Any, last: Any) -> Any:
    if not isinstance(first, types.Integer) or not isinstance(last, types.Integer):
        return None

    def build(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        coming = cgutils.alloca_once_value(builder, arguments[0])
        made = builder.insert_value(context.get_constant_undef(SPAN), coming, 0)
        return builder.insert_value(made, arguments[1], 1)

    return SPAN(types.intp, types.intp), build


span: Any = intrinsic(_span)
"""For loops: counts from first to last - 1, once. It is a tenth of what range is before LLVM."""


@lower_builtin("iternext", _Span)
def _advance_span(context: Any, builder: Any, call: Any, arguments: Any) -> Any:
    coming, last = (builder.extract_value(arguments[0], k) for k in range(2))
    number = builder.load(coming)
    builder.store(builder.add(number, number.type(1), flags=["nsw"]), coming)
    pair = builder.insert_value(context.get_constant_undef(call.return_type), number, 0)
    return builder.insert_value(pair, builder.icmp_signed("<", number, last), 1)
