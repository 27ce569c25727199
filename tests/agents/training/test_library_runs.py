"""A2C, DQN and QR-DQN as runs: saved agents, and values that are known in closed form."""

import numpy as np
import pytest

from agents.evaluation.registry import find_family
from agents.learned.policy import VALUE_THRESHOLDS
from agents.training.recipe import load_recipe
from agents.training.runs import make_run
from hybrid_env import QuickestLayout
from hybrid_env.registration import make_track_vector_env

ANNOUNCED, QUICKEST = "hybrid_env:HybridTrackPublished-v0", "hybrid_env:HybridTrackQuickest-v0"
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


@pytest.mark.parametrize("layers", ["[]", "[32]"])
def test_values_without_a_future_are_the_expected_reward_of_a_statement(layers):
    """With gamma 0 the value of a mode is its probability, less the cost of a change if that is
    wrong.
    """
    more = (
        "n_timesteps=60000",
        "gamma=0.0001",
        "exploration_initial_eps=1.0",
        "exploration_final_eps=1.0",
        *SMALL,
    )
    changes = (
        *more,
        f"policy_kwargs.net_arch={layers}",
        "observe=[posterior, stated]",
        "learning_rate=lin_1e-2",
    )
    run = make_run(QUICKEST, {}, load_recipe("q-linear", QUICKEST, changes), seed=1)
    run.train()
    env = make_track_vector_env(QUICKEST, 200, tick_info=False)
    layout = QuickestLayout(3)
    rows = env.reset(seed=7)[0]
    generator = np.random.default_rng(0)
    for _ in range(100):
        rows = env.step(generator.integers(3, size=200))[0]
    probability = np.exp(layout.read(rows, "log_probability"))
    stated = layout.read(rows, "stated")
    exact = probability - 5.0 * (1.0 - probability) * (1.0 - stated)
    found = run.family("").make(0.0).logits(rows)[0]
    error = found / run.recipe.settings.reward_scale - exact
    # Linear values lack the product of probability and statement: a quarter of the variance.
    assert error.std() < (0.6 if layers == "[]" else 0.15) * exact.std()
    assert abs(error.mean()) < 0.2
