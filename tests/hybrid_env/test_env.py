"""The single environment: reward, fast-forward, observation and info agree with their
definitions.
"""

import gymnasium as gym
import numpy as np
import pytest

from hybrid_env import HybridTrackEnv


def play(env, policy, seed):
    """Run one episode with policy(info) -> action. Returns rewards and infos."""
    _, info = env.reset(seed=seed)
    rewards = []
    infos = [info]
    terminated = False
    while not terminated:
        _, reward, terminated, truncated, info = env.step(policy(info))
        assert truncated is False
        rewards.append(reward)
        infos.append(info)
    return rewards, infos


def test_return_of_a_segment_decided_at_tick_k_is_plus_or_minus_one_minus_k_times_the_delay_cost():
    tick = 7
    env = HybridTrackEnv()
    rewards, infos = play(env, lambda info: 2 if info["tick"] == tick else 0, seed=4)
    decided = [info for info in infos if "decided_mode" in info]

    assert len(decided) == 6
    for info in decided:
        assert info["ticks"] == tick
        assert info["decided_mode"] == 1
        assert info["correct"] == (info["decided_true_mode"] == 1)
        assert not info["forced"]
    expected = sum((1.0 if info["correct"] else -1.0) - tick * 0.02 for info in decided)
    assert sum(rewards) == pytest.approx(expected)
    assert len(rewards) == 6 * tick


def test_waiting_on_the_last_tick_forces_a_decision_for_the_most_likely_hypothesis_in_that_step():
    env = HybridTrackEnv(scheme="L30r5 S40")
    rewards, infos = play(env, lambda info: 0, seed=1)

    assert len(rewards) == 70
    decided = [(k, info) for k, info in enumerate(infos) if "decided_mode" in info]
    assert [k for k, _ in decided] == [30, 70]
    for k, info in decided:
        assert info["forced"]
        assert info["ticks"] == info["decided_length"]
        assert info["decided_mode"] == infos[k - 1]["log_likelihood"].argmax()


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
