"""How the kernel's functions are compiled: small pieces, in which loops over lanes become SIMD code.

NumPy's error model lets a division stand in such a loop without the branch that would raise.
"""

from typing import Any

from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic

_options: dict[str, Any] = {"error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True}

formula = njit(inline="always", **_options)
"""A scalar formula that becomes part of the loop it stands in; Python must not call it."""

internal = njit(**_options)
"""A function for compiled code, and on disk a part of its caller; Python must not call it."""

compiled = njit(error_model="numpy", cache=True)
"""A function that Python calls; kept on disk."""


def _pointer(_context: Any, address: Any) -> Any:
    def cast(_: Any, builder: Any, __: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], cgutils.voidptr_t)

    return types.voidptr(address), cast


pointer: Any = intrinsic(_pointer)
"""The memory at an address, for `numba.carray`."""
