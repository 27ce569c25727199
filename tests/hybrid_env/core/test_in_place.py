"""Arrays and records in place against NumPy's own view of the same memory."""

import numba
import numpy as np
import pytest
from numba import njit

from hybrid_env.core.in_place import array_at, in_place, prefetch
from hybrid_env.core.records import LANES, lanes_of

PAIR = lanes_of(("left", np.float64, (3,)), ("right", np.int64, ()))
PACKED = np.dtype(
    [
        ("flag", np.bool_),
        ("small", np.float32),
        ("number", np.float64),
        ("count", np.int64),
        ("place", np.uintp),
    ]
)

ODD = np.dtype([("flag", np.bool_), ("numbers", np.float64, (2,))])


@njit
def _scale(array, factor):
    for i in range(array.shape[0]):
        for j in range(array.shape[1]):
            array[i, j] *= factor
    return array.size, array.nbytes, array.shape


@pytest.mark.parametrize("kind", [np.float64, np.float32, np.int64, np.uint64])
def test_an_array_at_an_address_is_the_array_itself(kind):
    @njit
    def scale(address, rows, columns):
        return _scale(array_at(address, (rows, columns), kind), 2)

    memory = np.arange(12).reshape(4, 3).astype(kind)
    expected = 2 * memory
    assert scale(memory.ctypes.data, 4, 3) == (memory.size, memory.nbytes, memory.shape)
    np.testing.assert_array_equal(memory, expected)
    assert _scale(memory, 1) == (memory.size, memory.nbytes, memory.shape)  # the same code takes NumPy's


def test_fewer_indices_leave_an_array():
    @njit
    def pick(address, a, b, c):
        cube = array_at(address, (a, b, c), np.int64)
        plane = cube[1]
        row = plane[2]
        other = cube[0, 1]
        row[0] = 70
        other[c - 1] = 71
        return plane.shape, row.shape, row[1], other[0], cube[1, 2, 0]

    memory = np.arange(24).reshape(2, 3, 4)
    assert pick(memory.ctypes.data, *memory.shape) == ((3, 4), (4,), memory[1, 2, 1], memory[0, 1, 0], 70)
    assert (memory[1, 2, 0], memory[0, 1, 3]) == (70, 71)
    untouched = np.ones(memory.shape, np.bool_)
    untouched[1, 2, 0] = untouched[0, 1, 3] = False
    np.testing.assert_array_equal(memory[untouched], np.arange(24).reshape(2, 3, 4)[untouched])


def test_truth_values_are_bytes():
    @njit
    def negate(address, count):
        flags = array_at(address, (count,), np.bool_)
        found = 0
        for k in range(count):
            found += 1 if flags[k] else 0
            flags[k] = not flags[k]
        return found

    flags = np.array([True, False, True, True, False])
    expected = ~flags
    assert negate(flags.ctypes.data, flags.size) == 3
    np.testing.assert_array_equal(flags, expected)


@njit
def _move_over(pair, k):
    for lane in range(pair.right.size):
        pair.right[lane] += np.int64(pair.left[k, lane])
        pair.left[k, lane] = -pair.left[k, lane]


@pytest.mark.parametrize("given", ["address", "array"])
def test_fields_of_a_record_are_its_lanes(given):
    @njit
    def at_address(address, count):
        pairs = array_at(address, (count,), PAIR)
        for b in range(count):
            _move_over(pairs[b], b)

    @njit
    def in_array(pairs):
        for b in range(pairs.size):
            _move_over(in_place(pairs[b]), b)

    memory = np.zeros(3, PAIR)
    memory["left"] = np.random.default_rng(0).integers(-99, 99, (3, 3, LANES))
    memory["right"] = np.arange(3 * LANES).reshape(3, LANES)
    expected = memory.copy()
    for b in range(3):
        expected["right"][b] += expected["left"][b, b].astype(np.int64)
        expected["left"][b, b] *= -1.0
    at_address(memory.ctypes.data, 3) if given == "address" else in_array(memory)
    np.testing.assert_array_equal(memory, expected)


def test_numbers_of_a_packed_record_need_no_alignment():
    @njit
    def read(address, count):
        total = 0.0
        for k in range(count):
            one = array_at(address, (count,), PACKED)[k]
            total += one.small + one.number + one.count + one.place + (1000.0 if one.flag else 0.0)
        return total

    memory = np.array([(True, 0.5, 0.25, -3, 7), (False, 1.5, 2.25, 5, 1)], PACKED)
    assert read(memory.ctypes.data, 2) == 1000.0 + 0.5 + 0.25 - 3 + 7 + 1.5 + 2.25 + 5 + 1


def test_prefetching_beyond_all_memory_does_nothing():
    @njit
    def ask(address, count):
        pairs = array_at(address, (count,), PAIR)
        prefetch(pairs, pairs.nbytes, np.float64)
        prefetch(pairs[count - 1], 1 << 40, PAIR)
        return pairs.nbytes

    memory = np.zeros(2, PAIR)
    assert ask(memory.ctypes.data, 2) == memory.nbytes
    np.testing.assert_array_equal(memory, np.zeros(2, PAIR))


def _unknown_field(pairs):
    return in_place(pairs[0]).middle


def _number_for_an_array(pairs):
    in_place(pairs[0]).left[0] = 1.0


def _number_for_a_record(pairs):
    array_at(0, (2,), PAIR)[0] = 1.0


def _too_many_indices(pairs):
    return in_place(pairs[0]).left[0, 1, 2]


def _fraction_for_an_index(pairs):
    return in_place(pairs[0]).right[1.0]


def _slice(pairs):
    return in_place(pairs[0]).left[:, 1]


def _counting_from_the_end(pairs):
    in_place(pairs[0]).right[-1] = 1


def _beyond_the_end(pairs):
    return in_place(pairs[0]).left[3, 0]


def _no_record(pairs):
    return in_place(pairs).right[0]


def _fraction_for_an_extent(pairs):
    return array_at(0, (2.0,), np.float64).size


def _prefetch_of_an_array_not_in_place(pairs):
    prefetch(pairs, 0, PAIR)


def _array_off_its_boundary(_pairs):
    return array_at(0, (1,), ODD)[0].numbers[0]


@pytest.mark.parametrize(
    "wrong",
    [
        _unknown_field,
        _number_for_an_array,
        _number_for_a_record,
        _too_many_indices,
        _fraction_for_an_index,
        _slice,
        _counting_from_the_end,
        _beyond_the_end,
        _no_record,
        _fraction_for_an_extent,
        _prefetch_of_an_array_not_in_place,
        _array_off_its_boundary,
    ],
)
def test_what_is_not_there_is_a_typing_error(wrong):
    with pytest.raises(numba.TypingError):
        njit(wrong)(np.zeros(1, PAIR))
