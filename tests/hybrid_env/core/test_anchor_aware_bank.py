"""The anchor-aware and the oracle bank are finite for extreme options and in the space for exact anchors."""

import itertools

import numpy as np
import pytest

from hybrid_env import HybridTrackEnv, HybridTrackVectorEnv


def test_the_oracle_bank_is_anchored_at_the_true_state():
    env = HybridTrackEnv(bank="oracle", scheme="L30r5 S20", heading=0.5)
    _, info = env.reset(seed=4)
    np.testing.assert_allclose(info["anchor"], [0, 2 * np.cos(0.5), 0, 2 * np.sin(0.5)], atol=1e-15)
    _, _, _, _, info = env.step(3)  # a wrong decision does not change the next anchor
    assert not info["correct"]
    assert np.hypot(*(info["anchor"] - info["truth"])[[0, 2]]) < 0.3


# the study has 10^7 steps
EXTREMES = list(itertools.product((1e-4, 0.1, 1e2), (0.01, 2.0, 100.0), (0.1, 5.0, 1e4)))


@pytest.mark.parametrize("bank", ["published", "anchor_aware"])
@pytest.mark.parametrize(
    "steps", [pytest.param(40, id="quick"), pytest.param(400, id="study", marks=pytest.mark.study)]
)
def test_observations_and_rewards_are_finite_for_extreme_noise_speed_and_radius(bank, steps):
    tracks = 1024
    for R, speed, radius in EXTREMES:
        env = HybridTrackVectorEnv(
            tracks,
            bank=bank,
            measurement_variance=R,
            speed=speed,
            radii=(radius, 3 * radius),
            tick_info=False,
        )
        rows, _ = env.reset(seed=1)
        generator = np.random.default_rng(2)
        for _ in range(steps):
            actions = np.where(generator.random(tracks) < 0.96, 0, generator.integers(0, 6, tracks))
            rows, rewards, _, _, _ = env.step(actions)
            assert np.isfinite(rows).all(), (R, speed, radius)
            assert np.isfinite(rewards).all()
        assert np.isfinite(env.world.copy_tick()()["log_likelihood"]).all()
        assert np.isfinite(env.world.field("estimate")).all()
        assert env.single_observation_space.contains(rows[0])


def test_a_diverged_filter_loses_likelihood_and_stays_finite():
    env = HybridTrackEnv(bank="anchor_aware", scheme="S9")
    env.reset(seed=0)
    bank = env.world.bank.hypotheses[0]
    bank["covariance"][1, 0], bank["covariance"][2, 0] = np.nan, -1.0
    for _ in range(5):
        *_, info = env.step(0)
    found = info["log_likelihood"]
    assert np.isfinite(found).all()
    assert found[0] > max(found[1:]) + 1000
    assert np.isfinite(bank["x"][:, 0]).all()


@pytest.mark.parametrize("R", [0.01, 0.1, 3.0])
def test_an_exact_anchor_gives_observations_in_the_space(R):
    # the variance of the first innovation equals R
    for options in ({"bank": "oracle"}, {"initial_error": 0, "reset_covariance": False}):
        env = HybridTrackVectorEnv(8, measurement_variance=R, **options)
        rows, _ = env.reset(seed=0)
        assert all(env.single_observation_space.contains(row) for row in rows)


def test_the_oracle_bank_rejects_reset_covariance():
    with pytest.raises(ValueError, match="reset_covariance=True"):
        HybridTrackEnv(bank="oracle", reset_covariance=True)
