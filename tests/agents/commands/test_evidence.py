"""The evidence of each decider, compared with the decisions that it makes."""

import numpy as np
import pytest

from agents.evaluation.registry import load_decider
from hybrid_env import HybridTrackVectorEnv

RADII = (3.0, 5.0, 8.0)
TRACKS = 30


def make_env():
    return HybridTrackVectorEnv(TRACKS, radii=RADII, correctness="type", tick_info=False)


def ticks_of(env, decider, count=60):
    """Play, and yield observation, actions and evidence at each tick."""
    observation, _ = env.reset(seed=0)
    state = None
    start = np.ones(TRACKS, np.bool_)
    for _ in range(count):
        values = decider.evidence(observation, state, start)
        assert values.shape == (TRACKS, 7)
        actions, state = decider.predict(observation, state, start)
        yield observation, actions, values
        observation, _, start, _, _ = env.step(actions)


@pytest.mark.parametrize("name", ["msprt-type:0.05", "gap:3"])
def test_a_decider_declares_the_mode_whose_evidence_reaches_the_threshold(name):
    env = make_env()
    decider = load_decider(name, env.options)
    (level,) = decider.panel().thresholds.values()
    declared = 0
    for _, actions, values in ticks_of(env, decider):
        clear = (np.abs(values - level) > 1e-9).all(axis=1)
        reached = (values >= level).any(axis=1)
        np.testing.assert_array_equal((actions > 0)[clear], reached[clear])
        chosen = actions[actions > 0] - 1
        np.testing.assert_array_equal(values[actions > 0, chosen], values[actions > 0].max(axis=1))
        declared += len(chosen)

    assert declared > 20
