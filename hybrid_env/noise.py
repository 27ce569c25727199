"""Random numbers of the kernel: a small xoshiro256++ generator a track, and standard normals from it.

A generator of its own for every track makes track i of a vector environment the very stream of a single
environment with the same seed, whatever the other tracks do. Blackman & Vigna 2021 (xoshiro256++); Box &
Muller 1958, whose pairs take the same steps for every draw, so that tracks can be drawn side by side.
"""

import math

import numpy as np
from numpy.typing import NDArray

from hybrid_env.compiled import formula, internal
from hybrid_env.elementary import ONE, log, sine_cosine


@formula
def next_uint64(state: NDArray[np.uint64], lane: int) -> np.uint64:
    """Next 64 random bits. state: (4, LANES), not all zero in the lane, advanced in place. xoshiro256++."""
    s0, s1, s2, s3 = state[0, lane], state[1, lane], state[2, lane], state[3, lane]
    total = s0 + s3
    bits = ((total << np.uint64(23)) | (total >> np.uint64(41))) + s0
    shifted = s1 << np.uint64(17)
    s2 ^= s0
    s3 ^= s1
    s1 ^= s2
    s0 ^= s3
    s2 ^= shifted
    s3 = (s3 << np.uint64(45)) | (s3 >> np.uint64(19))
    state[0, lane], state[1, lane], state[2, lane], state[3, lane] = s0, s1, s2, s3
    return bits


@formula
def uniform(state: NDArray[np.uint64], lane: int) -> float:
    """Uniform on [0, 1), 52 bits: they become the mantissa of a number in [1, 2)."""
    return np.uint64((next_uint64(state, lane) >> np.uint64(12)) | np.uint64(ONE)).view(np.float64) - 1.0


@internal
def integer_below(state: NDArray[np.uint64], lane: int, bound: int) -> int:
    """Uniform integer in 0 .. bound - 1; the bias of the product method is below bound / 2^52."""
    return int(uniform(state, lane) * bound)


@internal
def draw_normals(state: NDArray[np.uint64], normals: NDArray[np.float64], first: int, last: int) -> None:
    """Four independent draws of N(0, 1), none beyond 8.5, for each of the lanes first .. last - 1.

    state: (4, LANES), advanced. normals: (4, LANES), written.
    """
    for pair in range(2):
        for lane in range(np.uintp(first), np.uintp(last)):
            radius = math.sqrt(-2.0 * log(1.0 - uniform(state, lane)))
            sine, cosine = sine_cosine(2.0 * math.pi * uniform(state, lane))
            normals[2 * pair, lane] = radius * cosine
            normals[2 * pair + 1, lane] = radius * sine
