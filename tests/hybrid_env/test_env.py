"""The single environment: reward, fast-forward, observation and info agree with their
definitions.
"""

import math

import gymnasium as gym
import numpy as np
import pytest

from hybrid_env import HybridTrackEnv, HybridTrackQuickestEnv, KalmanBank, Layout, Sensor
from hybrid_env.core.memory import TRACE_COLUMNS


def play(env, policy, seed):
    """Run one episode with policy(info) -> action. Returns rewards, infos and observations."""
    observation, info = env.reset(seed=seed)
    rewards = []
    infos = [info]
    observations = [observation]
    terminated = False
    while not terminated:
        observation, reward, terminated, truncated, info = env.step(policy(info))
        assert truncated is False
        rewards.append(reward)
        infos.append(info)
        observations.append(observation)
    return rewards, infos, observations


def test_return_of_a_segment_decided_at_tick_k_is_plus_or_minus_one_minus_k_times_the_delay_cost():
    tick = 7
    env = HybridTrackEnv()
    rewards, infos, _ = play(
        env,
        lambda info: 2 if info["tick"] == tick else 0,
        seed=4,
    )
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
    rewards, infos, _ = play(env, lambda info: 0, seed=1)

    assert len(rewards) == 70
    decided = [(k, info) for k, info in enumerate(infos) if "decided_mode" in info]
    assert [k for k, _ in decided] == [30, 70]
    for k, info in decided:
        assert info["forced"]
        assert info["ticks"] == info["decided_length"]
        assert info["decided_mode"] == infos[k - 1]["log_likelihood"].argmax()


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"missed": 0.4},
        {"noise": "outliers 0.3", "missed": 0.4},
        {"noise": "levy 1.5", "missed": 0.2},
        {"noise": "student_t 3", "missed": 0.4},
        {
            "sensors": [Sensor(variance=0.2, range=9.0), Sensor(variance=0.05, period=7)],
            "missed": 0.1,
        },
    ],
)
def test_truth_and_measurements_do_not_depend_on_the_actions(options):
    first, second = (HybridTrackEnv(render_mode="rgb_array", **options) for _ in range(2))
    traces = []
    for env, policy in (
        (first, lambda info: 0),
        (second, lambda info: 3 if info["tick"] == 9 else 0),
    ):
        env.reset(seed=11)
        rows = [env.world.read_trace(0)]
        terminated = False
        info = {"tick": 1}
        while not terminated:
            _, _, terminated, _, info = env.step(policy(info))
            rows.append(env.world.read_trace(0))
        traces.append(np.concatenate(rows))

    np.testing.assert_array_equal(traces[0][:, :6], traces[1][:, :6])
    assert (traces[0][:, 6:] != traces[1][:, 6:]).any()


def test_the_object_follows_its_scheme_and_is_measured_with_the_given_variance():
    env = HybridTrackEnv(
        render_mode="rgb_array",
        scheme="S50 L100r5 R100r5",
        process_variance=0.0,
        measurement_variance=(0.1, 0.4),
        heading=0.5,
        speed=1.5,
    )
    env.reset(seed=0)
    rows = [env.world.read_trace(0)]
    terminated = False
    while not terminated:
        _, _, terminated, _, _ = env.step(0)
        rows.append(env.world.read_trace(0))
    trace = dict(zip(TRACE_COLUMNS, np.concatenate(rows).T, strict=True))

    assert len(trace["x"]) == 250
    np.testing.assert_allclose(
        trace["x"][49],
        50 * 0.1 * 1.5 * math.cos(0.5),
    )
    np.testing.assert_allclose(
        np.hypot(trace["vx"], trace["vy"]),
        1.5,
    )
    heading = np.unwrap(np.arctan2(trace["vy"], trace["vx"]))
    np.testing.assert_allclose(
        heading[149] - heading[49],
        100 * 0.1 * 1.5 / 5,
    )
    np.testing.assert_allclose(
        heading[249] - heading[149],
        -100 * 0.1 * 1.5 / 5,
    )
    for axis, variance in (
        ("x", 0.1),
        ("y", 0.4),
    ):
        errors = trace[f"measured_{axis}"] - trace[axis]
        # Variance of 250 normals: relative standard error sqrt(2 / 250).
        assert errors.var() == pytest.approx(variance, rel=4 * math.sqrt(2 / 250))


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"radii": (2.0, 5.0, 9.0)},
        {"measurement_variance": (0.1, 0.5)},
    ],
)
def test_info_and_observation_equal_those_of_a_separate_bank(options):
    env = HybridTrackEnv(**options)
    radii = env.options.radii
    layout = Layout(env.options.hypotheses)
    R = np.broadcast_to(env.options.variances, 2)
    observation, info = env.reset(seed=8)
    bank = KalmanBank(radii, measurement_variance=env.options.measurement_variance)
    previous = 0
    for step in range(150):
        if info["tick"] == 1:
            anchor = info["anchor"]
            heading = np.array([anchor[1], anchor[3]]) / np.hypot(anchor[1], anchor[3])
            bank.anchor(anchor)
            previous = info.get("decided_mode", 0)
        log_likelihood = bank.step(info["measurement"])
        np.testing.assert_allclose(
            info["log_likelihood"],
            log_likelihood,
            rtol=1e-12,
        )
        np.testing.assert_allclose(
            info["estimate"],
            bank.estimates[previous],
            rtol=1e-12,
        )
        variances = np.diagonal(
            bank.innovation_covariances,
            axis1=1,
            axis2=2,
        )
        white = bank.innovations / np.sqrt(variances)
        shift = (info["measurement"] - anchor[[0, 2]]) / np.sqrt(np.sqrt(R.prod()))
        posterior = np.exp(log_likelihood - log_likelihood.max())
        posterior /= posterior.sum()
        log_error = np.log(np.delete(posterior, posterior.argmax()).sum())
        curvature = np.concatenate([[0.0], 1 / np.array(radii), -1 / np.array(radii)])
        expected = {
            "log_ratio": np.maximum(log_likelihood - log_likelihood.max(), -30),
            "innovation_along": white @ heading,
            "innovation_across": white @ [-heading[1], heading[0]],
            "log_variance": np.log(variances / R).mean(1),
            "previous": np.eye(len(curvature))[previous],
            "curvature": curvature,
            "ticks": info["tick"],
            "log_error_probability": max(log_error, -30),
            "speed": np.hypot(anchor[1], anchor[3]),
            "displacement_along": shift @ heading,
            "displacement_across": shift @ [-heading[1], heading[0]],
            "log_noise": np.log(R).mean(),
        }
        for name, value in expected.items():
            np.testing.assert_allclose(
                layout.read(observation, name),
                value,
                rtol=2e-6,
                atol=2e-6,
                err_msg=name,
            )
        assert env.observation_space.contains(observation)
        action = 0
        if step % 40 == 39:
            action = 1 + int(log_likelihood.argmax())
        observation, _, _, _, info = env.step(action)


def test_the_declared_filter_runs_to_the_end_of_the_segment_and_provides_the_next_anchor():
    env = HybridTrackEnv(
        scheme="L40r5 S60",
        render_mode="rgb_array",
        initial_error=0,
        reset_covariance=False,
    )
    _, info = env.reset(seed=2)
    bank = KalmanBank()
    bank.anchor(info["anchor"], (0.0, 0.0, 0.0))
    bank.step(info["measurement"])
    for _ in range(9):
        _, _, _, _, info = env.step(0)
        bank.step(info["measurement"])
    observation, _, _, _, info = env.step(2)
    trace = dict(
        zip(
            TRACE_COLUMNS,
            env.world.read_trace(0).T,
            strict=True,
        )
    )

    assert trace["segment"].tolist() == [0] * 30 + [1]
    for x, y in zip(
        trace["measured_x"][:30],
        trace["measured_y"][:30],
        strict=True,
    ):
        bank.step([x, y])
    np.testing.assert_allclose(
        info["anchor"],
        bank.estimates[1],
        rtol=1e-11,
    )
    kept = bank.covariances[1, [0, 0, 1], [0, 1, 1]] / 0.1
    names = ("anchor_xx", "anchor_xv", "anchor_vv")
    np.testing.assert_allclose(
        [Layout(3).read(observation, name) for name in names],
        kept,
        rtol=1e-6,
    )
    # With reset_covariance=False the next segment starts with this covariance.
    bank.anchor(info["anchor"], bank.covariances[1])
    np.testing.assert_allclose(
        info["log_likelihood"],
        bank.step(info["measurement"]),
        rtol=1e-11,
    )
    assert (info["segment"], info["tick"]) == (1, 1)


def test_a_wrong_radius_is_correct_by_type_and_wrong_by_hypothesis():
    for correctness, expected in (
        ("type", True),
        ("exact", False),
    ):
        env = HybridTrackEnv(
            scheme="L50r2",
            radii=(2.0, 5.0),
            correctness=correctness,
        )
        env.reset(seed=0)
        _, reward, terminated, _, info = env.step(3)
        assert terminated
        assert (info["correct"], info["type_correct"]) == (expected, True)
        assert reward == (0.98 if expected else -1.02)


@pytest.mark.parametrize(
    "action",
    [-1, "n", 0.0, np.array([0, 1])],
)
@pytest.mark.parametrize("make", [HybridTrackEnv, HybridTrackQuickestEnv])
def test_an_invalid_action_raises_an_error_with_its_value(make, action):
    env = make()
    env.reset(seed=0)
    action = env.action_space.n if isinstance(action, str) else action
    with pytest.raises(
        gym.error.InvalidAction,
        match=r"^action=.*expected an integer from 0 \(\w+\) to \d$",
    ):
        env.step(action)


def test_step_requires_a_running_episode():
    env = HybridTrackEnv(scheme="S1")
    with pytest.raises(gym.error.ResetNeeded):
        env.step(0)
    env.reset(seed=0)

    assert env.step(0)[2]
    with pytest.raises(gym.error.ResetNeeded):
        env.step(0)
