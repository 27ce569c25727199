"""The Stable-Baselines3 view of the environment."""

import numpy as np
from gymnasium.vector import AutoresetMode

from agents.training.vec_env import HybridTrackVecEnv
from hybrid_env import HybridTrackQuickestVectorEnv

ENV_ID = "HybridTrackQuickest-v0"
SHORT = {"ticks": 40, "durations": "uniform 5-12"}


def test_the_stable_baselines3_view_has_the_same_rows_and_rewards():
    view = HybridTrackVecEnv(ENV_ID, 4, **SHORT)
    env = HybridTrackQuickestVectorEnv(4, autoreset_mode=AutoresetMode.SAME_STEP, **SHORT)
    view.seed(9)

    np.testing.assert_array_equal(view.reset(), env.reset(seed=9)[0])
    total = np.zeros(4)
    for k in range(45):
        actions = np.full(4, k // 4 % 3)
        rows, rewards, done, infos = view.step(actions)
        expected, expected_rewards, terminated, _, info = env.step(actions)
        np.testing.assert_array_equal(rows, expected)
        np.testing.assert_array_equal(rewards, expected_rewards.astype(np.float32))
        np.testing.assert_array_equal(done, terminated)
        total += expected_rewards
        if done.all():
            assert [info["episode"]["l"] for info in infos] == [40] * 4
            np.testing.assert_allclose([info["episode"]["r"] for info in infos], total)
            np.testing.assert_array_equal(infos[2]["terminal_observation"], info["final_obs"][2])
            total[:] = 0.0
    assert set(view.state_arrays()) >= {
        "blocks.random_state",
        "hypotheses.log_probability",
        "returns",
    }
