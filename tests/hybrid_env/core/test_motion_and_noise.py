"""Turns are circles, and random numbers have the published stream and the specified distributions."""

import math

import numpy as np
import pytest
from scipy import stats

from hybrid_env.core.compilation import compiled
from hybrid_env.core.motion import heading_vector, motion_coefficients, propagate, turn_centre
from hybrid_env.core.noise import integer_below, next_uint64, uniform
from hybrid_env.core.records import LANES


@pytest.mark.parametrize("radius", [5.0, -5.0, 0.3])
def test_a_turn_stays_on_its_circle_and_keeps_its_speed(radius):
    state = np.array([1.0, 1.2, -2.0, 1.6])
    speed, heading_x, heading_y = heading_vector(state[1], state[3])
    centre = turn_centre(state[0], state[2], heading_x, heading_y, radius)
    rate = speed / abs(radius)
    coefficients = motion_coefficients(rate, 0.1)
    start = math.atan2(state[2] - centre[1], state[0] - centre[0])
    for k in range(1, 200):
        state[0], state[1] = propagate(state[0], state[1], centre[0], *coefficients)
        state[2], state[3] = propagate(state[2], state[3], centre[1], *coefficients)
        angle = start + math.copysign(rate, radius) * 0.1 * k
        expected = np.array(centre) + abs(radius) * np.array([math.cos(angle), math.sin(angle)])
        np.testing.assert_allclose(state[[0, 2]], expected, atol=1e-11)
        assert math.hypot(state[1], state[3]) == pytest.approx(2.0, abs=1e-11)


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
    # first outputs of the reference implementation of xoshiro256++ from the state (1, 2, 3, 4)
    state = np.zeros((4, LANES), np.uint64)
    state[:, 2] = [1, 2, 3, 4]
    expected = [41943041, 58720359, 3588806011781223, 3591011842654386, 9228616714210784205, 9973669472204895162]
    assert [int(value) for value in bits(state, len(expected))] == expected
    assert not state[:, [0, 1, *range(3, LANES)]].any()


def test_uniforms_and_integers_are_uniform():
    assert stats.kstest(uniforms(seeded(6), 100_000), "uniform").pvalue > 1e-3
    counts = np.bincount(integers(seeded(7), 70_000, 7), minlength=7)
    assert counts.size == 7
    assert stats.chisquare(counts).pvalue > 1e-3
