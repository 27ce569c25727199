"""Single instructions of the processor, which compiled code can ask for and Python cannot."""

from typing import Any

from numba import types
from numba.extending import intrinsic


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
