"""Evaluation and operating curves on cases whose answer is known."""

import numpy as np
import pytest

from agents.comparison.episode_figure import fly
from agents.evaluation.deciders import FIXED_TIME, DeciderFamily, load_decider
from agents.evaluation.evaluate import Decisions, evaluate, interval
from agents.evaluation.operating_curve import (
    ACCURACY,
    NEVER,
    OperatingCurve,
    at_threshold,
    error_at_ticks,
    sweep,
    ticks_at_accuracy,
)
from baselines import FixedTimeDecider, SPRTDecider
from hybrid_env import HybridTrackEnv, WorldOptions

ENV = "hybrid_env:HybridTrack-v0"


def test_evaluation_equals_single_environments_played_one_by_one():
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


def test_every_episode_counts_once_and_all_deciders_see_the_same():
    first = evaluate(FixedTimeDecider(1), ENV, episodes=7, seed=2)
    second = evaluate(FixedTimeDecider(40), ENV, episodes=7, seed=2)
    assert first.correct.shape == (7, 6)
    np.testing.assert_array_equal(first.true_mode, second.true_mode)
    np.testing.assert_array_equal(first.length, second.length)
    assert (first.ticks == 1).all()
    assert (second.ticks == 40).all()


def test_rmse_is_taken_over_ticks():
    kept = np.zeros((1, 2), bool), np.zeros((1, 2), bool), np.ones((1, 2), int), np.zeros((1, 2), bool)
    modes = np.zeros((1, 2), int)
    decisions = Decisions(*kept, modes, modes, np.array([[10, 30]]), np.array([[40.0, 120.0]]), 0.02)
    assert decisions.rmse == pytest.approx(2.0)


def test_the_interval_covers_the_mean_as_often_as_it_says():
    generator = np.random.default_rng(4)
    trials, covered = 300, 0
    for _ in range(trials):
        low, high = interval(generator.exponential(1.0, 200))
        covered += low <= 1.0 <= high
    # 95 % of 300: 285, standard deviation 3.8; percentile bootstraps of skewed values fall 1 or 2 % short
    assert 285 - 0.02 * trials - 4 * 3.8 <= covered <= 300


def test_an_interval_of_equal_episodes_is_a_point():
    assert interval(np.full(20, 3.0)) == (3.0, 3.0)


def curve(accuracy, ticks, episodes=50):
    """An operating curve whose means are given; every episode is the same."""
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


def test_times_and_errors_are_read_off_the_curve_linearly():
    line = curve([0.5, 0.9, 1.0], [10, 20, 40])
    assert line.figure(ticks_at_accuracy(0.95)).value == pytest.approx(30.0)
    assert line.figure(ticks_at_accuracy(0.4)).value == pytest.approx(10.0)
    assert line.figure(error_at_ticks(15.0)).value == pytest.approx(0.3)
    assert line.figure(error_at_ticks(99.0)).value == pytest.approx(0.0)
    assert line.figure(at_threshold(ACCURACY, 1)).value == pytest.approx(0.9)
    assert line.best_index() == 1  # .8 - .4 against 0 - .2 and 1 - .8


def test_an_accuracy_that_is_never_reached_is_infinite_and_null_in_json():
    figure = curve([0.5, 0.9], [10, 20]).figure(ticks_at_accuracy(0.99))
    assert np.isinf([figure.value, figure.low, figure.high]).all()
    assert figure.as_json() == {"value": None, "low": None, "high": None}
    assert NEVER > 1e6


def test_paired_differences_are_known_better_than_the_figures():
    late = sweep(FIXED_TIME, ENV, 60, 5, thresholds=[20.0])
    later = sweep(FIXED_TIME, ENV, 60, 5, thresholds=[21.0])
    statistic = at_threshold(ACCURACY, 0)
    one, other = late.figure(statistic), later.figure(statistic)
    paired = later.difference(late, statistic)
    assert paired.value == pytest.approx(other.value - one.value)
    unpaired = np.hypot(one.high - one.low, other.high - other.low)
    assert paired.high - paired.low < 0.85 * unpaired


def test_a_flight_is_what_the_evaluation_counts():
    decider = SPRTDecider(1e-3)
    found = evaluate(decider, episodes=4, seed=10)
    flight = fly("ATE", decider, "hybrid_env:HybridTrack-v0", 12)
    np.testing.assert_array_equal(flight.correct, found.correct[2])
    np.testing.assert_array_equal(np.diff(flight.ends, prepend=0), found.length[2])
    np.testing.assert_array_equal(flight.decided - (flight.ends - found.length[2]), found.ticks[2])
    assert flight.reward == pytest.approx(found.reward[2].mean())
    assert len(flight.trace) == flight.ends[-1]
    error = flight.column("estimate_x") - flight.column("x"), flight.column("estimate_y") - flight.column("y")
    assert (error[0] ** 2 + error[1] ** 2).sum() == pytest.approx(found.squared_error[2].sum())


def test_leaving_out_finished_tracks_changes_no_decision(monkeypatch):
    import agents.evaluation.evaluate

    decider = load_decider("shipped:0.1", WorldOptions())
    found = []
    for share in (1.0, 0.0):
        monkeypatch.setattr(agents.evaluation.evaluate, "WORTH", share)
        found.append(evaluate(decider, episodes=30, seed=3))
    np.testing.assert_array_equal(found[0].ticks, found[1].ticks)
    np.testing.assert_array_equal(found[0].decided_mode, found[1].decided_mode)
