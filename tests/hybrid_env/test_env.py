"""The single environment: rewards, and actions that are not allowed."""

import gymnasium as gym
import numpy as np
import pytest

from baselines import FixedTimeDecider
from baselines.rules.rollout import record_decisions
from hybrid_env import HybridTrackEnv


@pytest.mark.parametrize("tick", [7, 60, 1000])
def test_a_decision_earns_or_costs_one_and_every_tick_of_the_segment_before_costs(tick):
    """A segment that ends undecided is decided."""
    made = record_decisions(FixedTimeDecider(tick), "hybrid_env:HybridTrackPublished-v0", 5, 4)

    np.testing.assert_array_equal(made.forced, made.length < tick)
    np.testing.assert_array_equal(made.ticks, np.minimum(tick, made.length))
    np.testing.assert_array_equal(made.correct, made.decided_mode == made.true_mode)
    earned = np.where(made.correct, 1.0, -1.0) - 0.02 * made.ticks
    np.testing.assert_allclose(made.reward, earned)
    assert 0.0 < made.correct.mean() < 1.0


def test_a_wrong_radius_is_correct_by_type_and_wrong_by_hypothesis():
    for correctness, expected in (("type", True), ("exact", False)):
        env = HybridTrackEnv(scheme="L50r2", radii=(2.0, 5.0), correctness=correctness)
        env.reset(seed=0)
        _, reward, terminated, _, info = env.step(3)
        assert terminated
        assert (info["correct"], info["type_correct"]) == (expected, True)
        assert reward == (0.98 if expected else -1.02)


def test_a_step_needs_a_running_episode_and_an_action_of_its_space():
    env = HybridTrackEnv(scheme="S1")
    with pytest.raises(gym.error.ResetNeeded):
        env.step(0)
    env.reset(seed=0)
    for action in (-1, 9, 0.0, np.array([0, 1])):
        with pytest.raises(gym.error.InvalidAction):
            env.step(action)

    assert env.step(0)[2]
    with pytest.raises(gym.error.ResetNeeded):
        env.step(0)
