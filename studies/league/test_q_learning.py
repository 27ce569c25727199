"""Q-learning on the rows: values that are known in closed form."""

import gymnasium as gym
import numpy as np
import pytest

from agents import train
from hybrid_env import QuickestLayout
from studies.league.families import recipe_file
from studies.league.protocol import QUICKEST


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
        "buffer_size=5000",
        "learning_starts=500",
    )
    changes = (
        *more,
        f"policy_kwargs.net_arch={layers}",
        "observe=[posterior, stated]",
        "learning_rate=lin_1e-2",
    )
    agent = train(recipe_file("q-linear"), QUICKEST, seed=1, changes=changes)
    env = gym.make_vec(QUICKEST, 200, vectorization_mode="vector_entry_point", tick_info=False)
    layout = QuickestLayout(3)
    rows = env.reset(seed=7)[0]
    generator = np.random.default_rng(0)
    for _ in range(100):
        rows = env.step(generator.integers(3, size=200))[0]
    probability = np.exp(layout.read(rows, "log_probability"))
    stated = layout.read(rows, "stated")
    exact = probability - 5.0 * (1.0 - probability) * (1.0 - stated)
    # The scale of the rewards in the recipe.
    error = agent.logits(rows)[0] / 0.1 - exact
    # Linear values lack the product of probability and statement: a quarter of the variance.
    assert error.std() < (0.6 if layers == "[]" else 0.15) * exact.std()
    assert abs(error.mean()) < 0.2
