"""Elementary functions agree with those of NumPy; random numbers have the published stream and are
uniform.
"""

import numpy as np
import pytest
from scipy import stats

from hybrid_env.core.compilation import compiled
from hybrid_env.core.elementary import exp, log, sine_cosine
from hybrid_env.core.memory import LANES
from hybrid_env.core.noise import integer_below, next_uint64, uniform


@pytest.mark.parametrize(
    ("ours", "theirs", "draws"),
    [
        (log, np.log, lambda rng: rng.lognormal(0, 30, 50_000)),
        (exp, np.exp, lambda rng: rng.uniform(-700, 700, 50_000)),
        (lambda x: sine_cosine(x)[0], np.sin, lambda rng: rng.uniform(-1000, 1000, 50_000)),
        (lambda x: sine_cosine(x)[1], np.cos, lambda rng: rng.uniform(-1000, 1000, 50_000)),
    ],
    ids=["log", "exp", "sine", "cosine"],
)
def test_elementary_functions_are_accurate_to_some_units_in_the_last_place(ours, theirs, draws):
    x = np.append(draws(np.random.default_rng(1)), [1.0, 0.3, np.pi / 6])
    ours = compiled(ours)
    expected = theirs(x)
    # An angle of 1,000 has an error of its own.
    of_angle = 3e-16 * (1.0 + np.abs(x)) if theirs in (np.sin, np.cos) else 0.0
    errors = np.abs([ours(value) for value in x] - expected)
    assert (errors <= 2.0 * np.spacing(np.abs(expected)) + of_angle).all()


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
