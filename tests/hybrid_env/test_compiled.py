"""What compiled code is made of: arrays at addresses, and garbage collection that comes back."""

import gc

import numba
import numpy as np
import pytest

from hybrid_env.compiled import compiled
from hybrid_env.instructions import array_at, prefetch
from hybrid_env.lanes import lanes_of

PAIR = lanes_of(("left", np.float64, ()), ("right", np.float64, ()))


def test_an_array_at_an_address_is_the_array_itself_and_prefetching_leaves_it_alone():
    @compiled
    def double(address, rows, columns):
        table = array_at(address, (rows, columns), np.float64)
        for row in range(rows):
            prefetch(table, row * columns, 8 * columns)  # beyond the last row, too
            for column in range(columns):
                table[row, column] *= 2.0
        return table.sum()

    memory = np.arange(12.0).reshape(4, 3)
    expected = 2.0 * memory
    assert double(memory.ctypes.data, 4, 3) == expected.sum()
    np.testing.assert_array_equal(memory, expected)


def test_records_at_an_address_have_their_fields():
    @compiled
    def move_over(address, count):
        pairs = array_at(address, (count,), PAIR)
        for k in range(count):
            for lane in range(pairs[k].left.size):
                pairs[k].right[lane] = pairs[k].left[lane] + k

    memory = np.zeros(3, PAIR)
    memory["left"] = np.random.default_rng(0).normal(size=memory["left"].shape)
    move_over(memory.ctypes.data, 3)
    np.testing.assert_array_equal(memory["right"], memory["left"] + np.arange(3.0)[:, None])


@pytest.mark.parametrize("collects", [True, False])
def test_compiling_leaves_garbage_collection_as_it_was(collects):
    @compiled
    def fine(x):
        return x + 1

    @compiled
    def broken(x):
        return x.nothing

    was = gc.isenabled()
    try:
        (gc.enable if collects else gc.disable)()
        assert fine(1) == 2
        assert gc.isenabled() is collects
        with pytest.raises(numba.TypingError):
            broken(1)
        assert gc.isenabled() is collects
    finally:
        (gc.enable if was else gc.disable)()
