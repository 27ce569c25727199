"""Agents decide and train the same, whatever default type and device of PyTorch a program has
set.
"""

import numpy as np
import pytest
import torch
from small_training import small_run

from agents.evaluation.registry import load_decider, shipped_names
from baselines.rules.decider import ANNOUNCED, UNKNOWN
from baselines.rules.rollout import record_decisions, record_statements
from hybrid_env import QuickestOptions, WorldOptions

AGENTS = [(name, task) for task in (ANNOUNCED, UNKNOWN) for name in shipped_names(task)]


@pytest.fixture
def set_defaults():
    """A function that changes the defaults of PyTorch, until the test ends."""

    def change(dtype=torch.float64, device="meta"):
        torch.set_default_dtype(dtype)
        torch.set_default_device(device)

    yield change
    change(torch.float32, None)


def results(name, task):
    """What an agent of the package decides in a few episodes."""
    if task == ANNOUNCED:
        return np.asarray(
            record_decisions(load_decider(name, WorldOptions()), episodes=2, seed=3).ticks
        )
    options = {"ticks": 25, "durations": "uniform 8-12"}
    decider = load_decider(name, QuickestOptions(**options))
    return np.asarray(record_statements(decider, 2, 5, **options).stated_modes)


@pytest.mark.parametrize("agent", AGENTS, ids=":".join)
def test_shipped_agents_decide_the_same(agent, set_defaults):
    expected = results(*agent)
    set_defaults()

    np.testing.assert_array_equal(results(*agent), expected)


@pytest.mark.parametrize("kind", ["ppo", "network"])
def test_a_step_of_training_gives_the_same_weights(kind, set_defaults):
    weights = []
    for change in (lambda: None, set_defaults):
        change()
        run = small_run(kind, steps=1, seed=3)
        run.train()
        weights.append(run.network.state_dict())
    for name, expected in weights[0].items():
        assert weights[1][name].device.type == "cpu"
        assert torch.equal(weights[1][name], expected)
