"""Optimal stopping against dynamic programming on a scalar problem, and calibration of the
banks.
"""

import math

import numpy as np
import pytest
from scipy import stats

from baselines.rules.bayes_risk import stopping_boundary
from baselines.rules.posterior_paths import PosteriorPaths, calibration, simulate_posterior_paths

DRIFT, LAST, COST = 0.35, 60, 0.02


def gaussian_paths(count, seed):
    """Posterior paths of two hypotheses with observations N(+-DRIFT, 1)."""
    generator = np.random.default_rng(seed)
    # Ln p(true) / p(other).
    ratio = (
        2
        * DRIFT
        * np.cumsum(
            generator.normal(DRIFT, 1, (count, LAST)),
            axis=1,
        )
    )
    log_error_probability = -np.logaddexp(0, np.abs(ratio))
    return PosteriorPaths(log_error_probability, ratio > 0, np.full(count, LAST))


def optimal_value():
    """Expected reward of the optimal rule, by backward induction on a grid of the log-likelihood
    ratio.
    """
    grid = np.linspace(-14, 14, 1401)
    posterior = 1 / (1 + np.exp(-grid))
    stop = 2 * np.maximum(posterior, 1 - posterior) - 1
    step = 2 * DRIFT**2
    spread = 2 * DRIFT
    width = grid[1] - grid[0]
    up = stats.norm.pdf(grid[None, :], grid[:, None] + step, spread) * width
    down = stats.norm.pdf(grid[None, :], grid[:, None] - step, spread) * width
    transition = posterior[:, None] * up + (1 - posterior)[:, None] * down
    transition /= transition.sum(1, keepdims=True)
    value = stop
    for _ in range(LAST - 1):
        value = np.maximum(stop, transition @ value - COST)
    # The first tick, from a log-ratio of 0; it has no cost here.
    first = 0.5 * (stats.norm.pdf(grid, step, spread) + stats.norm.pdf(grid, -step, spread)) * width
    return float(first @ value)


def reward_of(boundary, paths):
    declares = paths.log_error_probability <= boundary
    declares[:, -1] = True
    when = declares.argmax(1)
    correct = paths.correct[np.arange(len(when)), when]
    return np.where(correct, 1.0, -1.0) - COST * when


def test_stopping_boundary_earns_the_optimal_reward_of_dynamic_programming():
    boundary = stopping_boundary(gaussian_paths(20_000, 1), COST)
    rewards = reward_of(boundary, gaussian_paths(40_000, 2))
    error = rewards.std() / math.sqrt(rewards.size)
    best = optimal_value()
    # The regression may lose 0.005, half a per cent of the reward of a correct decision.
    assert rewards.mean() > best - 0.005 - 4 * error
    assert rewards.mean() < best + 4 * error


STUDY = pytest.mark.study


@pytest.mark.parametrize(
    "R",
    [pytest.param(0.01, marks=STUDY), 0.1, pytest.param(1.0, marks=STUDY)],
)
def test_anchor_aware_posterior_is_calibrated_and_published_posterior_is_overconfident(R):
    aware = simulate_posterior_paths(5000, 5, bank="anchor_aware", measurement_variance=R)
    # 30,000 segments: the standard error of the accuracy is at most 0.3 percentage points.
    for tick in (2, 5, 10, 20, 40):
        bins = calibration(aware, tick)
        assert abs(bins.mean_stated - bins.mean_accuracy) < 0.012
        for stated, accuracy, count in zip(bins.stated, bins.accuracy, bins.count, strict=True):
            if count:
                error = math.sqrt(max(stated * (1 - stated), 1e-4) / count)
                assert abs(stated - accuracy) < 0.02 + 4 * error
    kept = simulate_posterior_paths(
        5000,
        5,
        bank="published",
        reset_covariance=False,
        measurement_variance=R,
    )
    # The standard error is 0.003.
    least_gap = {
        0.01: 0.005,
        0.1: 0.03,
        1.0: 0.04,
    }[R]
    bins = calibration(kept, 10)

    assert bins.mean_stated - bins.mean_accuracy > least_gap
