"""The environment with unknown switch moments: statements, rewards and options."""

import numpy as np

from hybrid_env import HybridTrackQuickestEnv, HybridTrackQuickestVectorEnv, QuickestLayout

SHORT = {"ticks": 40, "durations": "uniform 5-12"}


def test_statements_change_nothing_but_rewards_and_their_own_features():
    envs = [
        HybridTrackQuickestVectorEnv(20, tick_info=True, measurement_variance=0.3) for _ in range(2)
    ]
    layout = QuickestLayout(3)
    rows = [env.reset(seed=5)[0] for env in envs]
    generator = np.random.default_rng(0)
    for _ in range(400):
        for name in set(layout.slices) - {"stated", "stated_ticks"}:
            np.testing.assert_array_equal(*(layout.read(each, name) for each in rows))
        rows = [env.step(generator.integers(0, 3, 20))[0] for env in envs]
    np.testing.assert_array_equal(*(env.world.field("truth") for env in envs))


def test_rewards_follow_the_statement_and_its_changes():
    env = HybridTrackQuickestEnv(change_cost=2.5, **SHORT)
    layout = QuickestLayout(3)
    row, info = env.reset(seed=3)
    generator = np.random.default_rng(3)
    stated = None
    count = 0
    for k in range(40):
        np.testing.assert_array_equal(layout.read(row, "stated"), np.arange(3) == stated)
        np.testing.assert_allclose(layout.read(row, "stated_ticks"), count, rtol=1e-6)
        action = (
            int(generator.integers(3)) if generator.random() < 0.4 or stated is None else stated
        )
        right = action == info["true_mode"]
        changed = stated is not None and action != stated
        row, reward, terminated, truncated, info = env.step(np.int64(action))
        assert reward == (1.0 if right else -2.5 if changed else 0.0)
        assert (terminated, truncated) == (k == 39, False)
        count = 1 if changed else count + 1
        stated = action


def test_a_known_start_is_a_switch_to_a_mode_that_the_bank_knows():
    env = HybridTrackQuickestVectorEnv(1000, tick_info=True, durations="uniform 50-100")
    _, info = env.reset(seed=2)
    modes = info["true_mode"]

    assert (np.bincount(modes) > 250).all()
    probability = np.exp(info["log_probability"])[np.arange(1000), modes]
    np.testing.assert_allclose(probability, 1 - 1 / 75, atol=2e-3)
