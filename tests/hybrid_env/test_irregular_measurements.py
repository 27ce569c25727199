"""Missed measurements and several sensors."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from stable_baselines3.common.env_checker import check_env as check_env_sb3

from hybrid_env import HybridTrackEnv, HybridTrackVectorEnv, Sensor

SENSORS = (
    Sensor(variance=0.4, period=2),
    Sensor(variance=0.05, position=(3.0, 4.0), range=4.0),
    Sensor(variance=2.0, position=(-3.0, 0.0), range=6.0, period=3),
)


def test_independent_measurements_of_a_tick_equal_successive_corrections():
    rng = np.random.default_rng(1)
    sensors = [Sensor(variance=v) for v in (0.1, 0.3, 2.0)]
    env = HybridTrackEnv(scheme="S9", sensors=sensors)
    env.reset(seed=0)
    weights = np.array([1 / 0.1, 1 / 0.3, 1 / 2.0])
    assert env.world.field("variance_ratio")[0] == pytest.approx(1 / weights.sum() / 0.1)
    # corrections one after the other with the same variances give the state of the fused one
    z = rng.normal(size=(3, 2))
    P, x = np.diag([0.3, 0.2, 0.3, 0.2]) + 0.05, rng.normal(size=4)
    H = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0]])

    def correct(x, P, z, R):
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R * np.eye(2))
        return x + K @ (z - H @ x), P - K @ H @ P

    one, covariance = x, P
    for k in range(3):
        one, covariance = correct(one, covariance, z[k], 1 / weights[k])
    mean = (weights[:, None] * z).sum(0) / weights.sum()
    together = correct(x, P, mean, 1 / weights.sum())
    np.testing.assert_allclose(one, together[0])
    np.testing.assert_allclose(covariance, together[1])


def test_fused_errors_have_the_stated_variance():
    sensors = [Sensor(variance=0.4, period=2), Sensor(variance=0.1, position=(0.0, 50.0), range=50.1)]
    env = HybridTrackVectorEnv(4000, scheme="S9", sensors=sensors, heading=0.0, process_variance=0.0)
    _, info = env.reset(seed=1)
    seen = []
    for _ in range(9):
        error = info["measurement"] - info["truth"][:, [0, 2]]
        ratio = env.world.field("variance_ratio")
        known = ~np.isnan(error[:, 0])
        seen.append(known.mean())
        if known.any():
            white = error[known] / np.sqrt(0.1 * ratio[known])[:, None]
            assert white.var() == pytest.approx(1.0, abs=5 * np.sqrt(2 / white.size))
        info = env.step(np.zeros(4000, np.int64))[4]
    assert seen[0] == 1.0


def test_a_sensor_measures_at_its_period_and_in_its_range():
    sensor = Sensor(variance=0.1, period=3, position=(1.0, 0.0), range=1.5)
    env = HybridTrackEnv(scheme="S40", sensors=[sensor], heading=0.0, process_variance=0.0)
    _, info = env.reset(seed=0)
    for k in range(1, 40):
        distance = np.hypot(info["truth"][0] - 1.0, info["truth"][2])
        assert np.isnan(info["measurement"][0]) == ((k - 1) % 3 != 0 or distance > 1.5), k
        *_, info = env.step(0)


def test_one_sensor_of_variance_r_is_the_plain_world():
    plain, sensed = HybridTrackVectorEnv(9), HybridTrackVectorEnv(9, sensors=[Sensor(variance=0.1)])
    rows, others = plain.reset(seed=2)[0], sensed.reset(seed=2)[0]
    generator = np.random.default_rng(0)
    for _ in range(300):
        np.testing.assert_allclose(rows, others, atol=2e-4)
        actions = np.where(generator.random(9) < 0.05, generator.integers(1, 4, 9), 0)
        rows, others = plain.step(actions)[0], sensed.step(actions)[0]


@pytest.mark.parametrize("env_id", ["HybridTrack-v0", "HybridTrackQuickest-v0"])
@pytest.mark.parametrize(
    "options", [{"missed": 0.1, "noise": "levy 1.5"}, {"sensors": [*SENSORS, Sensor(variance=1.0)]}]
)
@pytest.mark.filterwarnings("ignore:.*:UserWarning")
def test_the_environment_checkers_accept_noises_missing_measurements_and_sensors(env_id, options):
    # Gymnasium's checker compares the info of two first ticks, where NaN would not equal NaN
    env = gym.make(f"hybrid_env:{env_id}", **options).unwrapped
    check_env(env, skip_render_check=True)
    check_env_sb3(env, skip_render_check=True)
