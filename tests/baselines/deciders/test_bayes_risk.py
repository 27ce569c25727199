"""Optimal stopping against dynamic programming on a problem of one number, and calibration of the banks."""

import math

import numpy as np
import pytest
from scipy import stats

from agents.evaluation.evaluate import evaluate
from baselines import MSPRTDecider
from baselines.deciders.bayes_risk import BayesRiskDecider, stopping_boundary
from baselines.deciders.waited_paths import Paths, at_tick, calibration, waited_paths
from hybrid_env.checks import ArgumentError

DRIFT, LAST, COST = 0.35, 60, 0.02


def gaussian_paths(count, seed):
    """Two hypotheses, N(+-DRIFT, 1) a tick: log-doubts and who is right."""
    generator = np.random.default_rng(seed)
    ratio = 2 * DRIFT * np.cumsum(generator.normal(DRIFT, 1, (count, LAST)), axis=1)  # of the truth
    doubt = -np.logaddexp(0, np.abs(ratio))
    return Paths(doubt, ratio > 0, np.full(count, LAST), "hypothesis")


def optimal_value():
    """Expected reward of the best rule, by backward induction on a grid of the log-ratio."""
    grid = np.linspace(-14, 14, 1401)
    posterior = 1 / (1 + np.exp(-grid))
    stop = 2 * np.maximum(posterior, 1 - posterior) - 1
    step, spread = 2 * DRIFT**2, 2 * DRIFT
    width = grid[1] - grid[0]
    up = stats.norm.pdf(grid[None, :], grid[:, None] + step, spread) * width
    down = stats.norm.pdf(grid[None, :], grid[:, None] - step, spread) * width
    transition = posterior[:, None] * up + (1 - posterior)[:, None] * down
    transition /= transition.sum(1, keepdims=True)
    value = stop
    for _ in range(LAST - 1):
        value = np.maximum(stop, transition @ value - COST)
    # from even odds to the first tick, which is not paid for here
    first = 0.5 * (stats.norm.pdf(grid, step, spread) + stats.norm.pdf(grid, -step, spread)) * width
    return float(first @ value)


def reward_of(boundary, paths):
    declares = paths.doubt <= boundary
    declares[:, -1] = True
    when = declares.argmax(1)
    right = paths.right[np.arange(len(when)), when]
    return np.where(right, 1.0, -1.0) - COST * when


def test_the_boundary_earns_what_dynamic_programming_says_is_possible():
    boundary = stopping_boundary(gaussian_paths(20_000, 1), COST)
    rewards = reward_of(boundary, gaussian_paths(40_000, 2))
    error = rewards.std() / math.sqrt(rewards.size)
    best = optimal_value()
    assert (
        rewards.mean() > best - 0.005 - 4 * error
    )  # half a percent of a decision's worth for the regression
    assert rewards.mean() < best + 4 * error


def test_a_cheaper_delay_waits_longer():
    paths = gaussian_paths(20_000, 3)
    cheap, dear = (stopping_boundary(paths, cost) for cost in (0.005, 0.05))
    assert (cheap[5:40] < dear[5:40]).all()


def test_it_earns_as_much_as_the_best_constant_threshold():
    waited = waited_paths(1000, 10**9, bank="anchor_aware")
    rule = BayesRiskDecider(stopping_boundary(waited, 0.02), waited.by)
    ours = evaluate(rule, episodes=1000, bank="anchor_aware").reward.mean(1)
    for alpha in (0.1, 0.03, 0.01):
        theirs = evaluate(MSPRTDecider(alpha), episodes=1000, bank="anchor_aware").reward.mean(1)
        gain = ours - theirs
        assert gain.mean() > -4 * gain.std() / math.sqrt(gain.size)


@pytest.mark.parametrize("R", [0.01, 0.1, 1.0])
def test_the_anchor_aware_posterior_is_calibrated_and_the_published_one_is_not(R):
    aware = waited_paths(5000, 5, bank="anchor_aware", measurement_variance=R)
    # of 30,000 segments; the share right has a deviation of at most 0.3 points
    for tick in (2, 5, 10, 20, 40):
        found = at_tick(aware, tick)
        assert abs(found.stated - found.right) < 0.012
        bins = calibration(aware, tick)
        for stated, actual, count in zip(bins.stated, bins.actual, bins.count, strict=True):
            if count:
                deviation = math.sqrt(max(stated * (1 - stated), 1e-4) / count)
                assert abs(stated - actual) < 0.02 + 4 * deviation
    kept = waited_paths(5000, 5, bank="published", reset_covariance=False, measurement_variance=R)
    over = {0.01: 0.005, 0.1: 0.03, 1.0: 0.04}[R]  # a deviation is .003
    assert at_tick(kept, 10).stated - at_tick(kept, 10).right > over


def test_waited_paths_are_those_of_the_segments():
    paths = waited_paths(3, 7, scheme="S5 L7r5 S3")
    assert paths.length.tolist() == [5, 7, 3] * 3
    assert paths.doubt.shape == (9, 7)
    assert (paths.doubt <= 0).all()


def test_paths_are_noted_up_to_a_tick_and_wait_for_the_likeliest_whatever_the_world_does():
    some, everything = waited_paths(20, 7, ticks=10), waited_paths(20, 7, undecided="keep")
    np.testing.assert_array_equal(some.doubt, everything.doubt[:, :10])
    assert (some.length == 10).all()


def test_nonsense_is_refused_in_one_line():
    paths = waited_paths(3, 7, scheme="S5 L7r5 S3")
    for bad in (0, 2.5, 8):
        with pytest.raises(ArgumentError, match="tick="):
            at_tick(paths, bad)
    with pytest.raises(ArgumentError, match="paths=9"):
        stopping_boundary(paths, 0.02)
    with pytest.raises(ArgumentError, match="seed=-1"):
        waited_paths(3, -1)
    for bad in ([], [np.nan], 3.0, "low"):
        with pytest.raises(ArgumentError, match="boundary"):
            BayesRiskDecider(bad)
    with pytest.raises(ArgumentError, match="by="):
        BayesRiskDecider([0.0], by="types")
