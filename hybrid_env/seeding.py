"""Seeds of many tracks at once.

The random stream of a track starts from four 64-bit words drawn from the generator that Gymnasium creates for
a seed. NumPy's SeedSequence, after O'Neill 2015, and PCG64 (O'Neill 2014, PCG XSL RR 128/64) are repeated here
in arrays: creating one generator per track takes a minute for a million tracks.
"""

from collections.abc import Sequence

import numpy as np
from gymnasium.utils import seeding
from numpy.typing import NDArray

Words = NDArray[np.uint64]

# constants of SeedSequence
INITIAL_A, MULTIPLIER_A = 0x43B0D7E5, 0x931E8875
INITIAL_B, MULTIPLIER_B = 0x8B51F9DD, 0x58F38DED
MIX_LEFT, MIX_RIGHT = np.uint32(0xCA01F9DD), np.uint32(0x4973F715)
POOL = 4  # words of the entropy pool

# multiplier of PCG64, high and low word
PCG_HIGH, PCG_LOW = 2549297995355413924, 4865540595714422341

LOW = np.uint64(0xFFFFFFFF)
HALF, SHIFT = np.uint64(32), np.uint32(16)


def random_states(seeds: Sequence[int | None]) -> Words:
    """Return the initial states of random streams, (n, 4), of seeds >= 0; None draws one from the system's entropy."""
    states = np.empty((len(seeds), 4), np.uint64)
    unseeded = np.array([seed is None for seed in seeds], np.bool_)
    words_of_system = 4 * int(unseeded.sum())
    states[unseeded] = np.random.SeedSequence().generate_state(words_of_system, np.uint64).reshape(-1, 4)
    small = np.array([seed is not None and seed < 2**64 for seed in seeds], np.bool_)
    words = [seed for seed in seeds if seed is not None and seed < 2**64]
    states[small] = _states_of(np.array(words, np.uint64))
    zero = (states == 0).any(1)  # the generator rejects a word of zero, once in 2^62 tracks
    for i, seed in enumerate(seeds):
        if seed is not None and (zero[i] or not small[i]):
            states[i] = state_of(seeding.np_random(seed)[0])
    return states


def state_of(generator: np.random.Generator) -> Words:
    """Return the state of a random stream drawn from a generator, (4,)."""
    return generator.integers(1, 2**64, 4, dtype=np.uint64)


class _Hash:
    """The hash of SeedSequence, whose constant changes with every call."""

    def __init__(self, initial: int, multiplier: int):
        self.constant, self.multiplier = initial, multiplier

    def __call__(self, value: NDArray[np.uint32]) -> NDArray[np.uint32]:
        value = value ^ np.uint32(self.constant)
        self.constant = self.constant * self.multiplier & 0xFFFFFFFF
        value = value * np.uint32(self.constant)
        return value ^ (value >> SHIFT)


def _states_of(seeds: Words) -> Words:
    """Return the first four outputs of PCG64 seeded by each of the seeds below 2^64, (n, 4)."""
    words = [(seeds & LOW).astype(np.uint32), (seeds >> HALF).astype(np.uint32)]
    words += [np.zeros_like(words[0])] * (POOL - len(words))
    hashed = _Hash(INITIAL_A, MULTIPLIER_A)
    pool = [hashed(word) for word in words]
    for source in range(POOL):
        for target in range(POOL):
            if source != target:
                mixed = MIX_LEFT * pool[target] - MIX_RIGHT * hashed(pool[source])
                pool[target] = mixed ^ (mixed >> SHIFT)
    hashed = _Hash(INITIAL_B, MULTIPLIER_B)
    halves = [hashed(pool[k % POOL]).astype(np.uint64) for k in range(8)]
    start_high, start_low, stream_high, stream_low = (halves[2 * k] | (halves[2 * k + 1] << HALF) for k in range(4))
    one = np.uint64(1)
    increment = (stream_high << one) | (stream_low >> np.uint64(63)), (stream_low << one) | one
    state = _add(*increment, start_high, start_low)  # a step from 0, plus the start
    state = _step(*state, *increment)
    outputs = []
    for _ in range(4):
        state = _step(*state, *increment)
        outputs.append(_output(*state))
    return np.stack(outputs, axis=1)


def _add(high: Words, low: Words, other_high: Words, other_low: Words) -> tuple[Words, Words]:
    """Return the sum modulo 2^128."""
    total = low + other_low
    return high + other_high + (total < low).astype(np.uint64), total


def _step(high: Words, low: Words, increment_high: Words, increment_low: Words) -> tuple[Words, Words]:
    """Return the next state: multiplier * state + increment modulo 2^128."""
    factor_high, factor_low = np.uint64(PCG_LOW >> 32), np.uint64(PCG_LOW & 0xFFFFFFFF)
    low_high, low_low = low >> HALF, low & LOW
    middle = low_high * factor_low + ((low_low * factor_low) >> HALF)
    carry = (middle & LOW) + low_low * factor_high
    upper = low_high * factor_high + (middle >> HALF) + (carry >> HALF)
    upper = upper + high * np.uint64(PCG_LOW) + low * np.uint64(PCG_HIGH)
    return _add(upper, low * np.uint64(PCG_LOW), increment_high, increment_low)


def _output(high: Words, low: Words) -> Words:
    """Return the output of PCG64: the xor of both words, rotated by the six highest bits."""
    word, rotation = high ^ low, high >> np.uint64(58)
    left: Words = (np.uint64(64) - rotation) & np.uint64(63)
    return (word >> rotation) | (word << left)
