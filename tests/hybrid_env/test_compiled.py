"""Compiling leaves the interpreter as it was, and internal functions work wherever they are called from."""

import gc

import numba
import pytest
from numba import njit
from numba.core.base import BaseContext
from numba.core.types.functions import BaseFunction

from hybrid_env.compiled import compiled, formula, internal


@pytest.mark.parametrize("collects", [True, False])
def test_compiling_leaves_garbage_collection_and_numba_as_they_were(collects):
    @compiled
    def fine(x):
        return x + 1

    @compiled
    def broken(x):
        return x.nothing

    was, patched = gc.isenabled(), (BaseFunction.get_call_type, BaseContext.get_abi_sizeof)
    try:
        (gc.enable if collects else gc.disable)()
        assert fine(1) == 2
        assert gc.isenabled() is collects
        with pytest.raises(numba.TypingError):
            broken(1)
        assert gc.isenabled() is collects
        assert patched == (BaseFunction.get_call_type, BaseContext.get_abi_sizeof)
    finally:
        (gc.enable if was else gc.disable)()


@formula
def _double(x):
    return 2 * x


@internal
def _add_doubles(x, y):
    return _double(x) + _double(y)


@pytest.mark.parametrize("compiler", [compiled, njit], ids=["ours", "numba's"])
def test_internal_functions_are_linked_into_callers_of_either_kind(compiler):
    @compiler
    def both(x, y):
        return _add_doubles(x, y) + _double(y)

    assert both(3, 4) == 22
    assert both(0.5, 0.25) == 2.0
