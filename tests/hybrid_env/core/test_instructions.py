"""Single instructions against what Python says."""

import itertools
import math
import struct

import numba
import numpy as np
import pytest
from numba import njit

from hybrid_env.core.instructions import larger, reinterpret, smaller, span

NUMBERS = [-float("inf"), -1e300, -1.5, 0.0, 5e-324, 1.0, 1e300, float("inf")]


@pytest.mark.parametrize("values", [NUMBERS, [-(2**63), -1, 0, 7, 2**63 - 1]], ids=["numbers", "integers"])
def test_larger_and_smaller(values):
    @njit
    def both(a, b):
        return larger(a, b), smaller(a, b)

    for a, b in itertools.product(values, repeat=2):
        assert both(a, b) == (max(a, b), min(a, b))
    assert both(2, 1.5) == both(1.5, 2) == (2.0, 1.5)
    for pair in itertools.product((math.nan, 0.0, -0.0, 1.0), repeat=2):
        for found, expected in zip(both(*pair), (max(pair), min(pair)), strict=True):
            assert struct.pack("<d", found) == struct.pack("<d", expected)  # which of equals, and NaN


def _largest_of_unsigned(x):
    return larger(np.uint64(x), np.uint64(1))


def _bits_of_half_a_word(x):
    return reinterpret(np.float32(x))


def _span_of_fractions(x):
    for k in span(0, 1.5):
        x += k
    return x


@pytest.mark.parametrize("wrong", [_largest_of_unsigned, _bits_of_half_a_word, _span_of_fractions])
def test_other_types_are_refused(wrong):
    with pytest.raises(numba.TypingError):
        njit(wrong)(1)


def test_bits_of_numbers_and_back():
    @njit
    def around(x):
        return reinterpret(x), reinterpret(reinterpret(x))

    for number in NUMBERS:
        (bits,) = struct.unpack("<q", struct.pack("<d", number))
        assert around(number) == (bits, number)


def test_a_span_counts_like_a_range():
    @njit
    def counted(first, last):
        return list(span(first, last))

    @njit
    def pairs(n):
        found = []
        for i in span(0, n):
            if i == 1:
                continue
            for j in span(i, n):
                if j == 3:
                    break
                found.append((i, j))
        return found

    @njit
    def generated(n):
        for k in span(0, n):
            yield 2 * k

    assert list(generated(5)) == [0, 2, 4, 6, 8]
    for first, last in itertools.product((-3, 0, 1, 8), repeat=2):
        assert counted(first, last) == list(range(first, last))
    assert pairs(5) == [(0, 0), (0, 1), (0, 2), (2, 2), (4, 4)]
