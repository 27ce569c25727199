"""The scalar formulas of the observation."""

import math

import pytest

from hybrid_env.core.observation_row import (
    LARGEST,
    LARGEST_ANCHOR,
    LOG_FLOOR,
    clipped_innovation,
    heading_frame,
    log_error_probability,
    mean_over_noise,
)


def test_a_vector_to_the_left_of_the_heading_has_a_positive_component_across():
    assert heading_frame(0.0, 2.0, 1.0, 0.0) == (0.0, 2.0)
    assert heading_frame(-2.0, 0.0, 0.0, 1.0) == (0.0, 2.0)
    along, across = heading_frame(3.0, 4.0, 0.6, 0.8)
    assert along == pytest.approx(5.0)
    assert across == pytest.approx(0.0)


def test_the_log_error_probability_is_that_of_all_other_hypotheses():
    for others in (1e-6, 0.5, 2.0):  # the most likely hypothesis has likelihood 1
        assert log_error_probability(others) == pytest.approx(math.log(others / (1.0 + others)), rel=1e-12)
    assert log_error_probability(0.0) == LOG_FLOOR


def test_innovations_are_clipped_at_both_bounds():
    assert [clipped_innovation(white) for white in (1e9, -1e9, 0.5)] == [LARGEST, -LARGEST, 0.5]


def test_covariances_are_divided_by_the_noise_variance_and_averaged_over_the_axes():
    assert mean_over_noise(0.2, 0.9, 0.1, 0.3) == pytest.approx(2.5)
    assert mean_over_noise(1e24, -3e24, 1e-18, 1e-18) == -LARGEST_ANCHOR
