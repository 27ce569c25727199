"""Compiling leaves the interpreter as it was, and internal functions work wherever they are called from."""

import gc
import os
import subprocess
import sys

import numba
import pytest
from numba import njit
from numba.core.base import BaseContext
from numba.core.types.functions import BaseFunction

from hybrid_env.core.compilation import compiled, formula, internal


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


PROGRAM = """
import numpy as np
from numba import njit, prange
from hybrid_env.core.compilation import compiled, internal
from hybrid_env.core.in_place import array_at

@internal
def total(address, count):
    found = 0.0
    for k in range(count):
        found += array_at(address, (count,), np.float64)[k]
    return found

@njit(parallel=True)
def doubled(values):
    out = np.empty_like(values)
    for k in prange(values.size):
        out[k] = 2.0 * values[k]
    return out

@compiled
def both(values, address):
    return doubled(values).sum() + total(address, values.size)

values = np.arange(1000.0)
print(both(values, values.ctypes.data), sum(both.stats.cache_hits.values()))
"""


def test_code_on_disk_works_in_another_process_with_what_it_calls(tmp_path):
    program = tmp_path / "program.py"
    program.write_text(PROGRAM)
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    for hits in (0, 1):
        printed = subprocess.check_output([sys.executable, program], env=environment, text=True)
        assert printed.split() == ["1498500.0", str(hits)]
