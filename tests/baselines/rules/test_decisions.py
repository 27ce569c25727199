"""Recorded decisions, against single environments."""

import numpy as np
import pytest

from baselines import SPRTDecider
from baselines.rules.rollout import record_decisions
from hybrid_env import HybridTrackEnv

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
