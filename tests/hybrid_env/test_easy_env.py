"""The environment for beginners: when a declaration counts, by the likelihoods of info."""

import gymnasium as gym
import numpy as np
import pytest

import hybrid_env  # noqa: F401


def mode_posteriors(info, by_type):
    """Posterior probabilities for equal priors, in double precision: (M,) or (3,) straight, left, right."""
    likelihood = np.exp(info["log_likelihood"] - info["log_likelihood"].max())
    posterior = likelihood / likelihood.sum()
    side = len(posterior) // 2
    return np.array([posterior[0], *map(sum, np.split(posterior[1:], [side]))]) if by_type else posterior


@pytest.mark.parametrize("by_type", [False, True])
def test_a_declaration_waits_until_a_mode_is_more_likely_than_all_others(by_type):
    options = {"radii": (3.0, 5.0)} | ({"correctness": "type"} if by_type else {})
    easy, plain = gym.make("HybridTrack-v0", **options), gym.make("HybridTrackPublished-v0", **options)
    generator = np.random.default_rng(5)
    waited = declared = 0
    for seed in range(10):
        row, info = easy.reset(seed=seed)
        assert row.tobytes() == plain.reset(seed=seed)[0].tobytes()
        done = False
        while not done:
            action = int(generator.integers(0, 6))
            early = mode_posteriors(info, by_type).max() <= 0.95
            waited, declared = waited + (early and action > 0), declared + (not early and action > 0)
            row, reward, done, _, info = easy.step(action)
            expected = plain.step(0 if early else action)
            assert row.tobytes() == expected[0].tobytes()
            assert (reward, done) == (expected[1], expected[2])
    assert waited > 100
    assert declared >= 10
