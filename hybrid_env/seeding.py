"""Seeds of many tracks: the words from which random streams start, drawn by Gymnasium's generator of a seed."""

from collections.abc import Sequence

import numpy as np
from gymnasium.utils import seeding
from numpy.typing import NDArray


def random_states(seeds: Sequence[int | None]) -> NDArray[np.uint64]:
    """Return the initial states of random streams, (n, 4), of seeds >= 0; None is a random one."""
    # raw words are faster, and those of `state_of`, which rejects a word of zero, once in 2^62 tracks
    states = np.array([np.random.PCG64(seed).random_raw(4) for seed in seeds], np.uint64).reshape(-1, 4)
    for i in np.flatnonzero((states == 0).any(1)).tolist():
        states[i] = state_of(seeding.np_random(seeds[i])[0])
    return states


def state_of(generator: np.random.Generator) -> NDArray[np.uint64]:
    """Return the state of a random stream drawn from a generator, (4,)."""
    return generator.integers(1, 2**64, 4, dtype=np.uint64)
