"""The bound on the reward of rules for announced switches."""

import numpy as np

from agents import find_decider, sweep, task_of
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


def test_fewer_decisions_have_a_lower_bound():
    every, eighth = (
        bound_scores(task_of("hybrid_env:HybridTrackBank-v0", {"decide_every": ticks}), 20, 0)
        for ticks in (1, 8)
    )
    assert (eighth.values <= every.values).all()
    assert np.all(every.values < 1.0)
