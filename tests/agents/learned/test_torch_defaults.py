"""Agents decide and train the same, whatever default type and device of PyTorch a program has
set.
"""

import functools
import subprocess
import sys

import numpy as np
import pytest
import torch
from small_training import small_run

from agents.evaluation.registry import load_decider, shipped_names
from baselines.rules.decider import ANNOUNCED, UNKNOWN
from baselines.rules.rollout import evaluate, record_statements
from hybrid_env import QuickestOptions, WorldOptions

DEFAULTS = {
    "float64": torch.float64,
    "meta": torch.device("meta"),
}
AGENTS = [(name, task) for task in (ANNOUNCED, UNKNOWN) for name in shipped_names(task)]


@pytest.fixture
def restored():
    """The defaults of PyTorch are those of before when the test ends."""
    yield
    torch.set_default_dtype(torch.float32)
    torch.set_default_device(None)


@pytest.fixture(params=DEFAULTS)
def set_default(request, restored):
    """A function that changes a default of PyTorch, until the test ends."""
    value = DEFAULTS[request.param]
    return lambda: (
        torch.set_default_dtype(value)
        if isinstance(value, torch.dtype)
        else torch.set_default_device(value)
    )


def results(name, task):
    """What an agent of the package decides in a few episodes."""
    if task == ANNOUNCED:
        return np.asarray(evaluate(load_decider(name, WorldOptions()), episodes=2, seed=3).ticks)
    options = {"ticks": 25, "durations": "uniform 8-12"}
    decider = load_decider(name, QuickestOptions(**options))
    return np.asarray(record_statements(decider, 2, 5, **options).stated_modes)


expected_results = functools.cache(results)


@pytest.mark.parametrize("agent", AGENTS, ids=":".join)
def test_shipped_agents_decide_the_same(agent, set_default):
    expected = expected_results(*agent)
    set_default()

    np.testing.assert_array_equal(results(*agent), expected)


@pytest.mark.parametrize("kind", ["ppo", "anchor"])
@pytest.mark.usefixtures("restored")
def test_a_step_of_training_gives_the_same_weights(kind):
    weights = []
    for dtype, device in (
        (torch.float32, "cpu"),
        (torch.float64, "meta"),
    ):
        torch.set_default_dtype(dtype)
        torch.set_default_device(device)
        run = small_run(kind, steps=1, seed=3)
        run.train()
        weights.append(run.network.state_dict())
    for name, expected in weights[0].items():
        assert weights[1][name].device.type == "cpu"
        assert torch.equal(weights[1][name], expected)


def test_modules_can_be_imported_after_the_defaults_have_changed():
    code = (
        "import importlib, pkgutil, torch; torch.set_default_dtype(torch.float64);"
        " torch.set_default_device('meta')\nfrom agents import learned\nfor module in"
        " pkgutil.iter_modules(learned.__path__):\n    for value in"
        " vars(importlib.import_module(f'agents.learned.{module.name}')).values():\n        assert"
        " not isinstance(value, torch.Tensor) or value.device.type == 'cpu'\n        assert not"
        " isinstance(value, torch.Tensor) or value.dtype != torch.float64"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
