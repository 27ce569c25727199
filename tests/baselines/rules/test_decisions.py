"""Recorded decisions, against single environments and on cases with known results."""

import dataclasses

import numpy as np
import pytest

from baselines import FixedTimeDecider, SPRTDecider
from baselines.rules import rollout
from baselines.rules.refiltering import KeptCovarianceDecider
from baselines.rules.rollout import evaluate
from baselines.scoring.decisions import COLUMNS, RMSE, Decisions
from baselines.scoring.scores import Scores
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
        found = decisions.correct[i], decisions.ticks[i], decisions.squared_error[i]
        np.testing.assert_array_equal(np.array(made, float).T, np.array(found, float))
        assert decisions.reward[i].sum() == pytest.approx(reward)


def test_every_episode_counts_once_and_is_the_same_for_all_deciders():
    first = evaluate(FixedTimeDecider(1), ENV, episodes=7, seed=2)
    second = evaluate(FixedTimeDecider(40), ENV, episodes=7, seed=2)
    assert first.correct.shape == (7, 6)
    np.testing.assert_array_equal(first.true_mode, second.true_mode)
    np.testing.assert_array_equal(first.length, second.length)
    assert (first.ticks == 1).all()
    assert (second.ticks == 40).all()


def test_figures_of_an_episode_are_those_of_its_segments():
    correct = np.array([[True, False, False, True]])
    flags, zeros, ones = np.zeros((1, 4), bool), np.zeros((1, 4), int), np.ones((1, 4), int)
    length, error = np.array([[10, 30, 10, 30]]), np.array([[40.0, 120.0, 40.0, 120.0]])
    found = Decisions(correct, correct, 5 * ones, flags, zeros, zeros, length, error, 0.02)
    figures = dict(zip(COLUMNS, found.figures[0], strict=True))
    assert figures["accuracy"] == figures["type_accuracy"] == 0.5
    assert figures["reward"] == pytest.approx(-0.1)
    assert (figures["wrong_after_correct"], figures["after_correct"]) == (1, 1)
    assert (figures["wrong_after_wrong"], figures["after_wrong"]) == (1, 2)
    scores = Scores("x", "k", (0.0,), COLUMNS, found.figures[..., None])
    assert scores.estimate(RMSE).value == pytest.approx(2.0)  # over ticks, not over segments


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_dropping_finished_tracks_does_not_change_decisions(share, monkeypatch):
    decider = KeptCovarianceDecider(WorldOptions(), 0.1)
    expected = evaluate(decider, episodes=30, seed=3)
    monkeypatch.setattr(rollout, "DROPPED_BELOW", share)
    found = evaluate(decider, episodes=30, seed=3)
    np.testing.assert_array_equal(found.ticks, expected.ticks)
    np.testing.assert_array_equal(found.decided_mode, expected.decided_mode)


def test_so_many_episodes_that_they_fill_the_memory_are_refused():
    with pytest.raises(ArgumentError, match="episodes=200000"):
        evaluate(FixedTimeDecider(1), ENV, episodes=200_000, scheme="random 100000x5")


def test_batches_do_not_change_decisions(monkeypatch):
    found = []
    for size in (700_000_000, 100_000):
        monkeypatch.setattr(rollout, "LARGEST_BATCH", size)
        found.append(evaluate(SPRTDecider(0.01), ENV, episodes=30, seed=3))
    for field in dataclasses.fields(found[0]):
        np.testing.assert_array_equal(getattr(found[0], field.name), getattr(found[1], field.name))
