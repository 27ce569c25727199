"""Evaluation and operating curves on cases with known results."""

import dataclasses

import numpy as np
import pytest
from agents.evaluation.deciders import FIXED_TIME, DeciderFamily, load_decider
from agents.evaluation.evaluate import Decisions, confidence_interval, evaluate, share_interval
from agents.evaluation.operating_curve import (
    ACCURACY,
    NOT_REACHED,
    OperatingCurve,
    at_threshold,
    error_at_ticks,
    sweep,
    ticks_at_accuracy,
)
from scipy import stats

from agents.evaluation import evaluate as evaluation
from baselines import FixedTimeDecider, SPRTDecider
from hybrid_env import HybridTrackEnv, WorldOptions
from hybrid_env.checks import ArgumentError

ENV = "hybrid_env:HybridTrack-v0"


def test_evaluation_agrees_with_single_environments():
    decisions = evaluate(SPRTDecider(0.01), ENV, episodes=4, seed=30)
    for i in range(4):
        env, decider, state = HybridTrackEnv(), SPRTDecider(0.01), None
        observation, _ = env.reset(seed=30 + i)
        made, reward, terminated = [], 0.0, False
        while not terminated:
            actions, state = decider.predict(observation[None], state)
            observation, earned, terminated, _, info = env.step(actions[0])
            reward += earned
            if "ticks" in info:
                made.append((info["correct"], info["ticks"], info["decided_squared_error"]))
        np.testing.assert_array_equal([row[0] for row in made], decisions.correct[i])
        np.testing.assert_array_equal([row[1] for row in made], decisions.ticks[i])
        np.testing.assert_array_equal([row[2] for row in made], decisions.squared_error[i])
        assert decisions.reward[i].sum() == pytest.approx(reward)


def test_every_episode_counts_once_and_is_the_same_for_all_deciders():
    first = evaluate(FixedTimeDecider(1), ENV, episodes=7, seed=2)
    second = evaluate(FixedTimeDecider(40), ENV, episodes=7, seed=2)
    assert first.correct.shape == (7, 6)
    np.testing.assert_array_equal(first.true_mode, second.true_mode)
    np.testing.assert_array_equal(first.length, second.length)
    assert (first.ticks == 1).all()
    assert (second.ticks == 40).all()


def test_the_rmse_is_averaged_over_ticks():
    arrays = np.zeros((1, 2), bool), np.zeros((1, 2), bool), np.ones((1, 2), int), np.zeros((1, 2), bool)
    modes = np.zeros((1, 2), int)
    decisions = Decisions(*arrays, modes, modes, np.array([[10, 30]]), np.array([[40.0, 120.0]]), 0.02)
    assert decisions.rmse == pytest.approx(2.0)


def test_the_confidence_interval_has_its_nominal_coverage():
    generator = np.random.default_rng(4)
    trials, covered = 300, 0
    for _ in range(trials):
        low, high = confidence_interval(generator.exponential(1.0, 200))
        covered += low <= 1.0 <= high
    # 95 % of 300: 285, standard deviation 3.8; percentile bootstraps undercover by 1 or 2 % on skewed data
    assert 285 - 0.02 * trials - 4 * 3.8 <= covered <= 300


def test_an_interval_of_equal_episodes_is_a_point():
    assert confidence_interval(np.full(20, 3.0)) == (3.0, 3.0)


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_the_interval_of_equal_shares_is_wilsons(share):
    episodes, z = 40, stats.norm.ppf(0.975)
    width = z**2 / (episodes + z**2)  # Wilson's interval of 0 of n is (0, z^2 / (n + z^2))
    expected = (0.0, width) if share == 0.0 else (1.0 - width, 1.0)
    assert share_interval(np.full(episodes, share)) == pytest.approx(expected)
    decisions = Decisions(
        np.full((episodes, 6), bool(share)), *(np.ones((episodes, 6), int) for _ in range(6)),
        np.ones((episodes, 6)), 0.02,
    )  # fmt: skip
    assert decisions.summary()["accuracy"]["interval"] == pytest.approx(expected)
    assert decisions.summary()["ticks"]["interval"] == (1.0, 1.0)


def test_the_interval_of_unequal_shares_is_that_of_the_bootstrap():
    shares = np.linspace(0.0, 1.0, 30)
    assert share_interval(shares) == confidence_interval(shares)
    assert share_interval(np.full(30, 0.5)) == (0.5, 0.5)


def test_accuracy_and_error_of_a_curve_without_errors_have_intervals():
    line = curve([0.5, 1.0], [10, 20])
    accuracy, error = (
        line.estimate_share(at_threshold(ACCURACY, 1)),
        line.estimate_share(error_at_ticks(30.0)),
    )
    assert accuracy.value == accuracy.high == 1.0
    assert accuracy.low == pytest.approx(1.0 - error.high)
    assert 0.0 < error.high < 0.1
    assert line.estimate_share(at_threshold(ACCURACY, 0)) == line.estimate(at_threshold(ACCURACY, 0))


def curve(accuracy, ticks, episodes=50):
    """An operating curve with given means; all episodes are equal."""
    decisions = []
    for right, time in zip(accuracy, ticks, strict=True):
        shape = (episodes, 100)
        correct = np.zeros(shape, bool)
        correct[:, : round(100 * right)] = True
        zeros, flags = np.zeros(shape, int), np.zeros(shape, bool)
        ones = np.ones(shape, int)
        decisions.append(
            Decisions(correct, correct, time * ones, flags, zeros, zeros, ones, zeros * 1.0, 0.02)
        )
    family = DeciderFamily("x", "k", tuple(map(float, range(len(ticks)))), 0.0, lambda _: FixedTimeDecider(1))
    return OperatingCurve(family, tuple(decisions))


def test_times_and_errors_are_interpolated_linearly():
    line = curve([0.5, 0.9, 1.0], [10, 20, 40])
    assert line.estimate(ticks_at_accuracy(0.95)).value == pytest.approx(30.0)
    assert line.estimate(ticks_at_accuracy(0.4)).value == pytest.approx(10.0)
    assert line.estimate(error_at_ticks(15.0)).value == pytest.approx(0.3)
    assert line.estimate(error_at_ticks(99.0)).value == pytest.approx(0.0)
    assert line.estimate(at_threshold(ACCURACY, 1)).value == pytest.approx(0.9)
    assert line.best_index() == 1  # .8 - .4 compared with 0 - .2 and 1 - .8


def test_an_accuracy_that_is_not_reached_is_infinite_and_null_in_json():
    estimate = curve([0.5, 0.9], [10, 20]).estimate(ticks_at_accuracy(0.99))
    assert np.isinf([estimate.value, estimate.low, estimate.high]).all()
    assert estimate.as_json() == {"value": None, "low": None, "high": None}
    assert NOT_REACHED > 1e6


def test_paired_differences_have_narrower_intervals():
    first = sweep(FIXED_TIME, ENV, 60, 5, thresholds=[20.0])
    second = sweep(FIXED_TIME, ENV, 60, 5, thresholds=[21.0])
    statistic = at_threshold(ACCURACY, 0)
    one, other = first.estimate(statistic), second.estimate(statistic)
    paired = second.difference(first, statistic)
    assert paired.value == pytest.approx(other.value - one.value)
    unpaired = np.hypot(one.high - one.low, other.high - other.low)
    assert paired.high - paired.low < 0.85 * unpaired


def test_dropping_finished_tracks_does_not_change_decisions(monkeypatch):
    import agents.evaluation.evaluate

    decider = load_decider("shipped:0.1", WorldOptions())
    found = []
    for fraction in (1.0, 0.0):
        monkeypatch.setattr(agents.evaluation.evaluate, "COMPACTION_FRACTION", fraction)
        found.append(evaluate(decider, episodes=30, seed=3))
    np.testing.assert_array_equal(found[0].ticks, found[1].ticks)
    np.testing.assert_array_equal(found[0].decided_mode, found[1].decided_mode)


def test_so_many_episodes_that_they_fill_the_memory_are_refused():
    with pytest.raises(ArgumentError, match="episodes=200000"):
        evaluate(FixedTimeDecider(1), ENV, episodes=200_000, scheme="random 100000x5")


def test_batches_do_not_change_decisions(monkeypatch):
    shares, found = [], []
    for size in (700_000_000, 100_000):
        monkeypatch.setattr(evaluation, "LARGEST_BATCH", size)
        found.append(evaluate(SPRTDecider(0.01), ENV, episodes=30, seed=3, on_progress=shares.append))
    for field in dataclasses.fields(found[0]):
        np.testing.assert_array_equal(getattr(found[0], field.name), getattr(found[1], field.name))
    assert shares[-1] == 1.0
    assert max(shares) == 1.0
