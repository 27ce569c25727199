"""Random numbers of the kernel: one xoshiro256++ generator per track, and standard normals from it.

Every track has a separate generator, so that a track of a vector environment has the same random stream as a
single environment with the same seed. Blackman & Vigna 2021 (xoshiro256++); Box & Muller 1958 (normals). The
Box-Muller method has no rejection step, so that several tracks, or several ticks of one track, can be drawn
with SIMD code.
"""

import math

import numpy as np
from numpy.typing import NDArray

from hybrid_env.core.compilation import inlined, internal
from hybrid_env.core.elementary import ONE, float_of, log, sine_cosine

OUTLIER = 5.0  # ratio of the standard deviations of outliers and other measurements

_Words = tuple[np.uint64, np.uint64, np.uint64, np.uint64]


@inlined
def _advance(s0: np.uint64, s1: np.uint64, s2: np.uint64, s3: np.uint64) -> tuple[np.uint64, _Words]:
    """Return the next 64 random bits and the next state. xoshiro256++."""
    total = s0 + s3
    bits = ((total << np.uint64(23)) | (total >> np.uint64(41))) + s0
    shifted = s1 << np.uint64(17)
    s2 ^= s0
    s3 ^= s1
    s1 ^= s2
    s0 ^= s3
    s2 ^= shifted
    s3 = (s3 << np.uint64(45)) | (s3 >> np.uint64(19))
    return bits, (s0, s1, s2, s3)


@inlined
def _to_uniform(bits: np.uint64) -> float:
    """Return a uniform number in [0, 1) with 52 random bits, the mantissa of a number in [1, 2)."""
    return float_of(np.int64((bits >> np.uint64(12)) | np.uint64(ONE))) - 1.0


@inlined
def next_uint64(state: NDArray[np.uint64], lane: int) -> np.uint64:
    """Return the next 64 random bits. state: (4, LANES), not all zero in the lane, advanced in place."""
    bits, words = _advance(state[0, lane], state[1, lane], state[2, lane], state[3, lane])
    state[0, lane], state[1, lane], state[2, lane], state[3, lane] = words
    return bits


@inlined
def uniform(state: NDArray[np.uint64], lane: int) -> float:
    """Return a uniform number in [0, 1)."""
    return _to_uniform(next_uint64(state, lane))


@inlined
def _draw_uniforms(state: NDArray[np.uint64], lane: int, noise: NDArray[np.float64], column: int) -> None:
    """Draw four uniforms into rows 0 .. 3 of a column, with the state in registers."""
    s0, s1, s2, s3 = state[0, lane], state[1, lane], state[2, lane], state[3, lane]
    for k in range(4):
        bits, (s0, s1, s2, s3) = _advance(s0, s1, s2, s3)
        noise[k, column] = _to_uniform(bits)
    state[0, lane], state[1, lane], state[2, lane], state[3, lane] = s0, s1, s2, s3


@internal
def integer_below(state: NDArray[np.uint64], lane: int, bound: int) -> np.int64:
    """Return a uniform integer in 0 .. bound - 1. The bias of the product method is below bound / 2^52."""
    return np.int64(uniform(state, lane) * bound)


@internal
def draw_noise(
    state: NDArray[np.uint64], noise: NDArray[np.float64], first: int, last: int, outliers: float
) -> None:
    """Draw the noise of one tick for lanes first .. last - 1.

    Args:
        state: (4, LANES), advanced in place.
        noise: (5, LANES), written in place. Rows 0 .. 3 are independent draws of N(0, 1) of magnitude below
            8.5; in an outlier rows 2 and 3 are multiplied by `OUTLIER`. Row 4 is temporary.
        outliers: fraction of ticks with outliers.
    """
    for lane in range(first, last):
        _draw_uniforms(state, lane, noise, lane)
    if outliers > 0.0:
        for lane in range(first, last):
            noise[4, lane] = uniform(state, lane)
    _to_normals(noise, first, last, outliers)


@internal
def draw_noise_ahead(
    state: NDArray[np.uint64], lane: int, noise: NDArray[np.float64], ticks: int, outliers: float
) -> None:
    """Draw the noise of up to LANES consecutive ticks of one lane; column k holds that of tick k."""
    for tick in range(ticks):
        _draw_uniforms(state, lane, noise, tick)
        if outliers > 0.0:
            noise[4, tick] = uniform(state, lane)
    _to_normals(noise, np.uint64(0), np.uint64(ticks), outliers)


@internal
def _to_normals(noise: NDArray[np.float64], first: int, last: int, outliers: float) -> None:
    """Transform the uniforms in columns first .. last - 1 to normals, and apply outliers."""
    for pair in range(2):
        k = 2 * pair
        for column in range(first, last):
            radius = math.sqrt(-2.0 * log(1.0 - noise[k, column]))
            sine, cosine = sine_cosine(2.0 * math.pi * noise[k + 1, column])
            noise[k, column] = radius * cosine
            noise[k + 1, column] = radius * sine
    if outliers > 0.0:
        for column in range(first, last):
            factor = OUTLIER if noise[4, column] < outliers else 1.0
            noise[2, column] *= factor
            noise[3, column] *= factor
