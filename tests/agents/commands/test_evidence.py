"""The evidence of each decider, compared with the decisions that it makes."""

import numpy as np
import pytest

from agents.evaluation.registry import load_decider
from baselines import rollout
from hybrid_env import HybridTrackVectorEnv


@pytest.mark.parametrize("name", ["msprt-type:0.05", "gap:3"])
def test_a_decider_declares_the_mode_whose_evidence_reaches_the_threshold(name):
    env = HybridTrackVectorEnv(30, radii=(3.0, 5.0, 8.0), correctness="type")
    decider = load_decider(name, env.options)
    (level,) = decider.panel().thresholds.values()
    declared, values = 0, None
    for now in rollout(env, decider, 0):
        if now.step:
            assert values.shape == (30, 7)
            clear = (np.abs(values - level) > 1e-9).all(axis=1)
            declares = now.actions > 0
            np.testing.assert_array_equal(declares[clear], (values >= level).any(axis=1)[clear])
            chosen = values[declares, now.actions[declares] - 1]
            np.testing.assert_array_equal(chosen, values[declares].max(axis=1))
            declared += len(chosen)
        if now.step == 60:
            break
        values = decider.evidence(now.observation, now.state, now.starts)

    assert declared > 20
