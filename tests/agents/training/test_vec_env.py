"""The Stable-Baselines3 view of the environment, and the arrays that hold the whole state of tracks."""

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from agents.training.checkpoint import check_tracks, track_arrays
from agents.training.vec_env import HybridTrackVecEnv
from hybrid_env import HybridTrackQuickestVectorEnv, HybridTrackVectorEnv

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
            assert [one["episode"]["l"] for one in infos] == [40] * 4
            np.testing.assert_allclose([one["episode"]["r"] for one in infos], total)
            np.testing.assert_array_equal(infos[2]["terminal_observation"], info["final_obs"][2])
            total[:] = 0.0
    assert set(view.state_arrays()) >= {"blocks.random_state", "hypotheses.log_probability", "returns"}


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
@pytest.mark.parametrize("bank", ["published", "anchor_aware"])
def test_tracks_with_copied_arrays_continue_with_equal_rows(bank, mode):
    first, second = (HybridTrackVectorEnv(11, bank=bank, autoreset_mode=mode) for _ in range(2))
    first.reset(seed=1)
    second.reset(seed=2)
    generator = np.random.default_rng(0)
    actions = generator.integers(4, size=(400, 11)) * (generator.random((400, 11)) < 0.1)
    for row in actions[:150]:
        first.step(row)
    arrays = track_arrays(first)
    for name, array in track_arrays(second).items():
        array[...] = arrays[name]
    check_tracks(second)
    for row in actions[150:]:
        for one, other in zip(first.step(row)[:3], second.step(row)[:3], strict=True):
            np.testing.assert_array_equal(one, other)
