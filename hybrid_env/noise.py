"""Random numbers of the kernel: one small xoshiro256++ generator a track, and standard normals from it.

A generator of its own for every track makes track i of a vector environment the very stream of a single
environment with the same seed, whatever the other tracks do. Blackman & Vigna 2021 (xoshiro256++);
Marsaglia & Tsang 2000 and Doornik 2005 (ziggurat with 128 layers).
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

LAYERS = 128
TAIL_START = 3.442619855899  # right edge of the lowest rectangle, for 128 layers of equal area
LAYER_AREA = 9.91256303526217e-3


def _ziggurat_tables() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Layer edges x_0 > x_1 > ... > x_128 = 0, and the density exp(-x^2/2) at each edge."""
    edge = np.empty(LAYERS + 1)
    edge[0] = LAYER_AREA / math.exp(-0.5 * TAIL_START**2)  # the base strip, tail included, as a rectangle
    edge[1] = TAIL_START
    for i in range(2, LAYERS):
        edge[i] = math.sqrt(-2.0 * math.log(LAYER_AREA / edge[i - 1] + math.exp(-0.5 * edge[i - 1] ** 2)))
    edge[LAYERS] = 0.0
    return edge, np.exp(-0.5 * edge**2)


EDGE, DENSITY = _ziggurat_tables()


@njit(cache=True)
def next_uint64(state: NDArray[np.uint64]) -> np.uint64:
    """Next 64 random bits. state: (4,) uint64, not all zero, advanced in place. xoshiro256++."""
    s0, s1, s2, s3 = state[0], state[1], state[2], state[3]
    total = s0 + s3
    bits = ((total << np.uint64(23)) | (total >> np.uint64(41))) + s0
    shifted = s1 << np.uint64(17)
    s2 ^= s0
    s3 ^= s1
    s1 ^= s2
    s0 ^= s3
    s2 ^= shifted
    s3 = (s3 << np.uint64(45)) | (s3 >> np.uint64(19))
    state[0], state[1], state[2], state[3] = s0, s1, s2, s3
    return bits


@njit(cache=True)
def uniform(state: NDArray[np.uint64]) -> float:
    """Uniform on [0, 1), 53 bits."""
    return float(next_uint64(state) >> np.uint64(11)) * 2.0**-53


@njit(cache=True)
def integer_below(state: NDArray[np.uint64], bound: int) -> int:
    """Uniform integer in 0 .. bound - 1; the bias of the product method is below bound / 2^53."""
    return int(uniform(state) * bound)


@njit(cache=True)
def standard_normal(state: NDArray[np.uint64]) -> float:
    """One draw of N(0, 1) by the ziggurat method: a single multiplication in 98.8 % of the draws."""
    while True:
        bits = next_uint64(state)
        layer = np.int64(bits & np.uint64(LAYERS - 1))
        # 53 high bits to [-1, 1): disjoint from the 7 low bits that choose the layer (Doornik 2005)
        signed = float(bits >> np.uint64(11)) * 2.0**-52 - 1.0
        x = signed * EDGE[layer]
        if abs(x) < EDGE[layer + 1]:
            return x
        if layer == 0:
            while True:  # Marsaglia's exponential wedge beyond TAIL_START
                tail = -math.log(1.0 - uniform(state)) / TAIL_START
                if -2.0 * math.log(1.0 - uniform(state)) > tail * tail:
                    return TAIL_START + tail if signed > 0.0 else -TAIL_START - tail
        elif DENSITY[layer] + uniform(state) * (DENSITY[layer + 1] - DENSITY[layer]) < math.exp(-0.5 * x * x):
            return x
