"""A2C, DQN and QR-DQN as runs: saved agents."""

import numpy as np
import pytest

from agents.evaluation.registry import find_family
from agents.learned.policy import VALUE_THRESHOLDS
from agents.training.recipe import load_recipe
from agents.training.runs import make_run

ANNOUNCED = "hybrid_env:HybridTrackPublished-v0"
SMALL = "buffer_size=5000", "learning_starts=500"


@pytest.mark.parametrize("kind", ["dqn", "qrdqn", "a2c"])
def test_a_saved_agent_decides_as_the_model_does(kind, tmp_path):
    pytest.importorskip("sb3_contrib")
    changes = ("n_envs=4", "policy_kwargs.net_arch=[8]", *(() if kind == "a2c" else SMALL))
    run = make_run(
        ANNOUNCED,
        {},
        load_recipe(kind, ANNOUNCED, changes),
        folder=tmp_path / "run",
        steps=1000,
    )
    run.train()
    family = find_family(str(tmp_path / "run"), run.world)

    assert (family.thresholds == VALUE_THRESHOLDS) == (kind != "a2c")
    rows = run.model.env.env.reset(seed=1)[0]
    expected, _ = run.model.predict(rows, deterministic=True)
    np.testing.assert_array_equal(
        family.make(0.0).predict(rows)[0],
        expected,
    )
