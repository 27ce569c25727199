"""The bound on the reward of rules for announced switches."""

import gymnasium as gym
import pytest

from agents import evaluate, find_decider, sweep, task_of
from agents.evaluation.bound import bound_scores
from baselines.scoring.scores import mean

EPISODES = 300


def test_no_threshold_of_a_rule_earns_more_than_the_bound_and_the_best_comes_near():
    task = task_of("hybrid_env:HybridTrack-v0", {"decide_every": 1, "follow": "bank"})
    bound = bound_scores(task, EPISODES, 50)
    rule = sweep(task, find_decider("msprt", task.options), EPISODES, 50)
    rewards = range(len(rule.thresholds))
    less = [bound.difference(rule, mean("reward"), 0, index) for index in rewards]
    assert min(each.high for each in less) > 0.0
    assert min(each.low for each in less) < 0.02


def test_the_reward_threshold_of_the_id_is_the_return_of_the_best_rule():
    rewards = evaluate("msprt:0.06", episodes=EPISODES, seed=50)["reward"]
    # Five standard errors of 1,800 segments; an episode has six.
    expected = pytest.approx(6.0 * rewards.value, abs=6.0 * 2.5 * (rewards.high - rewards.value))
    assert gym.spec("HybridTrack-v0").reward_threshold == expected
