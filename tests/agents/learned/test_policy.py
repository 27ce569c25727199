"""Actors of Stable-Baselines3 that state a mode at every tick; those that declare one:
`test_exchange`.
"""

import numpy as np
import pytest
import torch
from stable_baselines3.common.policies import ActorCriticPolicy

from agents.learned.policy import StatementPolicyDecider, read_actor
from hybrid_env import HybridTrackQuickestVectorEnv, QuickestLayout


def random_policy():
    torch.manual_seed(0)
    env = HybridTrackQuickestVectorEnv(1)
    spaces = env.single_observation_space, env.single_action_space
    return ActorCriticPolicy(*spaces, lambda _: 0.0, net_arch=[8], ortho_init=False)


def random_decider(*threshold):
    actor = read_actor(random_policy().state_dict())
    return StatementPolicyDecider(actor, np.arange(3), *threshold)


def statement_rows(stated):
    """Observation rows with given last statements."""
    layout = QuickestLayout(3)
    rows = np.random.default_rng(0).normal(size=(len(stated), layout.width)).astype(np.float32)
    rows[:, layout.slices["stated"]] = np.eye(3)[stated]
    return rows


def test_at_threshold_zero_the_most_probable_action_is_chosen():
    rows = statement_rows(np.random.default_rng(1).integers(0, 3, 400))
    expected, _ = random_policy().predict(rows, deterministic=True)

    np.testing.assert_array_equal(random_decider().predict(rows)[0], expected)


@pytest.mark.parametrize("margin", [0.05, 100.0])
def test_a_statement_changes_if_the_log_odds_exceed_the_margin(margin):
    decider = random_decider(margin)
    stated = np.random.default_rng(2).integers(0, 3, 300)
    rows = statement_rows(stated)
    logits = decider.logits(rows)[0]
    gain = logits.max(1) - logits[np.arange(300), stated]
    expected = np.where(gain > margin, logits.argmax(1), stated)

    np.testing.assert_array_equal(decider.predict(rows)[0], expected)
    assert (expected == stated).all() == (margin == 100.0)
