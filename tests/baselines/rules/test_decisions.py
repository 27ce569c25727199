"""Recorded decisions, against single environments and on cases with known results."""

import numpy as np
import pytest

from agents import task_of
from baselines import SPRTDecider
from baselines.rules.rollout import record_decisions
from baselines.scoring.decisions import Decisions
from baselines.scoring.scores import Scores
from hybrid_env import HybridTrackEnv, WorldOptions

ENV = "hybrid_env:HybridTrackPublished-v0"


def test_evaluation_agrees_with_single_environments():
    decisions = record_decisions(SPRTDecider(0.01), ENV, episodes=4, seed=30)
    for i in range(4):
        env = HybridTrackEnv()
        decider = SPRTDecider(0.01)
        state = None
        observation, _ = env.reset(seed=30 + i)
        made = []
        reward = 0.0
        terminated = False
        while not terminated:
            actions, state = decider.predict(observation[None], state)
            observation, earned, terminated, _, info = env.step(actions[0])
            reward += earned
            if "ticks" in info:
                made.append((info["correct"], info["ticks"], info["decided_squared_error"]))
        episode = decisions.correct[i], decisions.ticks[i], decisions.squared_error[i]
        np.testing.assert_array_equal(np.array(made, float).T, np.array(episode, float))
        assert decisions.reward[i].sum() == pytest.approx(reward)


def test_figures_of_an_episode_are_those_of_its_segments():
    correct = np.array([[True, False, False, True]])
    flags, zeros, ones = np.zeros((1, 4), bool), np.zeros((1, 4), int), np.ones((1, 4), int)
    length = np.array([[10, 30, 10, 30]])
    error = np.array([[40.0, 120.0, 40.0, 120.0]])
    reward = WorldOptions().segment_reward(correct, 5 * ones)
    decisions = Decisions(correct, correct, 5 * ones, flags, zeros, zeros, length, error, reward)
    values = dict(zip(Decisions.columns, decisions.values[0], strict=True))

    assert values["accuracy"] == values["type_accuracy"] == 0.5
    assert values["reward"] == pytest.approx(-0.1)
    scores = Scores("x", "k", (0.0,), Decisions.columns, decisions.values[..., None])
    # Over ticks, not over segments.
    assert scores.estimate(task_of(ENV).statistic("rmse")).value == pytest.approx(2.0)
