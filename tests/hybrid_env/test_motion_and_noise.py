"""Motion against circles, random numbers against their published stream and their distributions."""

import math

import numpy as np
import pytest
from scipy import stats

from hybrid_env.motion import heading_vector, motion_coefficients, propagate, turn_centre
from hybrid_env.noise import integer_below, next_uint64, standard_normal, uniform


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


def test_a_left_turn_bends_to_the_left_of_the_heading():
    assert turn_centre(0.0, 0.0, 1.0, 0.0, 3.0) == (0.0, 3.0)
    assert turn_centre(0.0, 0.0, 1.0, 0.0, -3.0) == (0.0, -3.0)


@pytest.mark.parametrize("rate", [0.0, 1e-200, 1e-12])
def test_a_turn_of_vanishing_rate_is_straight(rate):
    np.testing.assert_allclose(motion_coefficients(rate, 0.1), (1.0, 0.1, 0.0), atol=1e-20)


def test_an_object_that_stands_still_has_a_heading():
    assert heading_vector(0.0, 0.0) == (0.0, 1.0, 0.0)


def test_the_generator_gives_the_published_stream():
    # first outputs of xoshiro256++ from the state (1, 2, 3, 4), as its reference implementation gives them
    state = np.array([1, 2, 3, 4], np.uint64)
    expected = [
        41943041,
        58720359,
        3588806011781223,
        3591011842654386,
        9228616714210784205,
        9973669472204895162,
    ]
    assert [int(next_uint64(state)) for _ in expected] == expected


def draws(function, count, seed, *arguments):
    state = np.random.default_rng(seed).integers(1, 2**64, 4, dtype=np.uint64)
    return np.array([function(state, *arguments) for _ in range(count)])


def test_normals_pass_kolmogorov_smirnov_moments_and_tails():
    sample = draws(standard_normal, 400_000, 5)
    assert stats.kstest(sample, "norm").pvalue > 1e-3
    # standard errors of the moments of N(0, 1): 1, sqrt(2), sqrt(15), sqrt(96) over sqrt(n); 4 of them
    for power, moment, deviation in (
        (1, 0, 1),
        (2, 1, math.sqrt(2)),
        (3, 0, math.sqrt(15)),
        (4, 3, math.sqrt(96)),
    ):
        assert abs((sample**power).mean() - moment) < 4 * deviation / math.sqrt(sample.size)
    beyond = int((np.abs(sample) > 3.442619855899).sum())  # drawn by the tail branch alone
    assert stats.binomtest(beyond, sample.size, 2 * stats.norm.sf(3.442619855899)).pvalue > 1e-3
    tail = np.abs(sample[np.abs(sample) > 3.442619855899])
    assert stats.kstest(tail, lambda x: 1 - stats.norm.sf(x) / stats.norm.sf(3.442619855899)).pvalue > 1e-3
    assert abs(np.corrcoef(sample[:-1], sample[1:])[0, 1]) < 4 / math.sqrt(sample.size)


def test_uniforms_and_integers_are_uniform():
    assert stats.kstest(draws(uniform, 100_000, 6), "uniform").pvalue > 1e-3
    counts = np.bincount(draws(integer_below, 70_000, 7, 7), minlength=7)
    assert counts.size == 7
    assert stats.chisquare(counts).pvalue > 1e-3
