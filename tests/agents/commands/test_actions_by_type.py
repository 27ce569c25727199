"""Deciders declare hypotheses; in an environment whose actions are types they play all the
same.
"""

import numpy as np
import pytest

import agents
from baselines import rollout
from hybrid_env import ArgumentError
from hybrid_env.registration import make_track_vector_env

ENV = "hybrid_env:HybridTrackBank-v0"
SCHEME = {"scheme": "random 2x20-30"}


@pytest.mark.parametrize("name", ["msprt-type:0.03", "shipped"])
def test_a_loaded_decider_acts_in_the_action_space(name):
    options = SCHEME | {"decide_every": 1}
    env = make_track_vector_env(ENV, 5, **options)
    declared = 0
    for now in rollout(env, agents.load(name, ENV, **options), 0):
        assert env.action_space.contains(np.asarray(now.actions, np.int64))
        declared += np.count_nonzero(now.actions)
        if now.step == 60:
            break

    assert declared > 5


def test_a_decider_that_reads_every_tick_is_not_loaded_for_fewer_decisions():
    with pytest.raises(ArgumentError, match="decide_every=8 is not allowed: expected 1"):
        agents.load("shipped", ENV)
