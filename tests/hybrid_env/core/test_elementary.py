"""Elementary functions agree with those of NumPy; random numbers have the published stream and are
uniform.
"""

import math

import numpy as np
from scipy import stats

from hybrid_env.core.compilation import compiled
from hybrid_env.core.elementary import exp, log, sine_cosine
from hybrid_env.core.memory import LANES
from hybrid_env.core.noise import integer_below, next_uint64, uniform


def units(values, expected):
    """Return the maximum error in units in the last place."""
    return np.max(np.abs(values - expected) / np.spacing(np.abs(expected)))


def test_the_logarithm_is_accurate_to_two_units_in_the_last_place():
    generator = np.random.default_rng(1)
    x = np.concatenate(
        [
            generator.lognormal(0, 30, 50_000),
            generator.uniform(0.5, 2, 50_000),
            [1.0, 2.0**-1000, 1e300],
        ]
    )

    assert units(compiled(lambda x: np.array([log(v) for v in x]))(x), np.log(x)) <= 2
    # Finite, so that it can be clipped.
    assert log(0.0) < -700
    assert math.isfinite(log(-1.0))


def test_the_exponential_is_accurate_to_two_units_in_the_last_place():
    x = np.concatenate(
        [np.random.default_rng(2).uniform(-700, 700, 50_000), np.linspace(-1, 1, 25_001)]
    )
    assert units(compiled(lambda x: np.array([exp(v) for v in x]))(x), np.exp(x)) <= 2


def test_sine_and_cosine_are_accurate_for_large_angles():
    x = np.concatenate(
        [np.random.default_rng(3).uniform(-1000, 1000, 50_000), np.linspace(-7, 7, 25_001)]
    )
    pairs = np.array(compiled(lambda x: [sine_cosine(v) for v in x])(x))
    for k, function in enumerate((np.sin, np.cos)):
        assert np.all(np.abs(pairs[:, k] - function(x)) < 3e-16 * (1 + np.abs(x)))

    assert sine_cosine(0.0) == (0.0, 1.0)
    assert math.isclose(sine_cosine(math.pi / 6)[0], 0.5, rel_tol=1e-15)


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
