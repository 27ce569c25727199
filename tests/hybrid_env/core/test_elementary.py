"""Random numbers have the published stream and are uniform."""

import numpy as np
from scipy import stats

from hybrid_env.core.compilation import compiled
from hybrid_env.core.memory import LANES
from hybrid_env.core.noise import integer_below, next_uint64, uniform


@compiled
def bits(state, count):
    return [next_uint64(state, 2) for _ in range(count)]


@compiled
def uniforms(state, count):
    return np.array([uniform(state, 2) for _ in range(count)])


@compiled
def integers(state, count, bound):
    return np.array([integer_below(state, 2, bound) for _ in range(count)])


def seeded(seed):
    return np.random.default_rng(seed).integers(1, 2**64, (4, LANES), dtype=np.uint64)


def test_the_generator_gives_the_published_stream():
    # First outputs of the reference implementation of xoshiro256++ from the state (1, 2, 3, 4).
    state = np.zeros((4, LANES), np.uint64)
    state[:, 2] = [1, 2, 3, 4]
    expected = [
        41943041,
        58720359,
        3588806011781223,
        3591011842654386,
        9228616714210784205,
        9973669472204895162,
    ]

    assert [int(value) for value in bits(state, len(expected))] == expected
    assert not state[:, [0, 1, *range(3, LANES)]].any()


def test_uniforms_and_integers_are_uniform():
    assert stats.kstest(uniforms(seeded(6), 100_000), "uniform").pvalue > 1e-3
    counts = np.bincount(integers(seeded(7), 70_000, 7), minlength=7)
    assert counts.size == 7
    assert stats.chisquare(counts).pvalue > 1e-3
