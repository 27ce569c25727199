"""The single environment: reward, fast-forward, observation and info agree with their
definitions.
"""

import math

import gymnasium as gym
import numpy as np
import pytest

from hybrid_env import HybridTrackEnv, KalmanBank, Layout


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


def test_the_object_follows_its_scheme():
    env = HybridTrackEnv(
        render_mode="rgb_array",
        scheme="S50 L100r5 R100r5",
        process_variance=0.0,
        heading=0.5,
        speed=1.5,
    )
    env.reset(seed=0)
    terminated = False
    while not terminated:
        terminated = env.step(0)[2]
    history = env.history
    trace = {name: history.column(name) for name in ("x", "vx", "vy")}

    assert len(history.trace) == 250
    np.testing.assert_allclose(trace["x"][49], 50 * 0.1 * 1.5 * math.cos(0.5))
    np.testing.assert_allclose(np.hypot(trace["vx"], trace["vy"]), 1.5)
    heading = np.unwrap(np.arctan2(trace["vy"], trace["vx"]))
    np.testing.assert_allclose(np.diff(heading[[49, 149, 249]]), [3.0, -3.0])


@pytest.mark.parametrize(
    "modes",
    [{"radii": (2.0, 5.0, 9.0)}, {"modes": "straight, left 2, stop, accelerate 1, right 9"}],
)
def test_info_and_observation_equal_those_of_a_separate_bank(modes):
    R = np.array([0.1, 0.5])
    env = HybridTrackEnv(measurement_variance=R, reset_covariance=True, **modes)
    layout = Layout(env.options.hypotheses)
    observation, info = env.reset(seed=8)
    bank = KalmanBank(measurement_variance=R, **modes)
    previous = 0
    for step in range(150):
        if info["tick"] == 1:
            anchor = info["anchor"]
            heading = np.array([anchor[1], anchor[3]]) / np.hypot(anchor[1], anchor[3])
            bank.anchor(anchor)
            previous = info.get("decided_mode", 0)
        log_likelihood = bank.step(info["measurement"])
        np.testing.assert_allclose(info["log_likelihood"], log_likelihood, rtol=1e-12)
        np.testing.assert_allclose(info["estimate"], bank.estimates[previous], rtol=1e-12)
        variances = np.diagonal(bank.innovation_covariances, axis1=1, axis2=2)
        white = bank.innovations / np.sqrt(variances)
        shift = (info["measurement"] - anchor[[0, 2]]) / np.sqrt(np.sqrt(R.prod()))
        posterior = np.exp(log_likelihood - log_likelihood.max())
        posterior /= posterior.sum()
        log_error = np.log(np.delete(posterior, posterior.argmax()).sum())
        radii = [mode.signed_radius for mode in env.options.all_modes]
        curvature = np.array([1.0 / radius if radius else 0.0 for radius in radii])
        way = 0.1 * np.hypot(anchor[1], anchor[3])
        expected = {
            "log_ratio": np.maximum(log_likelihood - log_likelihood.max(), -30),
            "innovation_along": white @ heading,
            "innovation_across": white @ [-heading[1], heading[0]],
            "log_variance": np.log(variances / R).mean(1),
            "previous": np.eye(len(curvature))[previous],
            "turn_angle": way * curvature,
            "ticks": info["tick"],
            "log_error_probability": max(log_error, -30),
            "speed": way / np.sqrt(np.sqrt(R.prod())),
            "displacement_along": shift @ heading,
            "displacement_across": shift @ [-heading[1], heading[0]],
            "log_noise": 0.0,
            "measured": 1.0,
        }
        for name, value in expected.items():
            np.testing.assert_allclose(
                layout.read(observation, name), value, rtol=2e-6, atol=2e-6, err_msg=name
            )
        assert env.observation_space.contains(observation)
        action = 0
        if step % 40 == 39:
            action = 1 + int(log_likelihood.argmax())
        observation, _, _, _, info = env.step(action)


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
