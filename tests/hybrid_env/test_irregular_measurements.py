"""Missed measurements and several sensors: the banks equal filters in matrix form, tick by tick."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from matrix_filters import LiteralImm, MatrixExtendedKalmanFilter, MatrixKalmanFilter, transition_matrix
from stable_baselines3.common.env_checker import check_env as check_env_sb3

from hybrid_env import (
    HybridTrackEnv,
    HybridTrackQuickestEnv,
    HybridTrackVectorEnv,
    Layout,
    QuickestLayout,
    Sensor,
)

TICKS, TAU, Q = 60, 0.1, 0.001
SENSORS = (
    Sensor(variance=0.4, period=2),
    Sensor(variance=0.05, position=(3.0, 4.0), range=4.0),
    Sensor(variance=2.0, position=(-3.0, 0.0), range=6.0, period=3),
)
WORLDS = {
    "missed": {"missed": 0.4},
    "sensors": {"sensors": SENSORS},
    "both": {"sensors": SENSORS, "missed": 0.4, "noise": "levy 1.5 0.5 44"},
}


def measured(info):
    """Return the measurement of a tick, None without one."""
    missing = np.isnan(info["measurement"])
    assert missing[0] == missing[1]
    return None if missing[0] else info["measurement"]


@pytest.mark.parametrize("name", WORLDS)
@pytest.mark.parametrize("bank", ["published", "anchor_aware"])
def test_a_bank_equals_matrix_filters_that_only_predict_in_a_tick_without_a_measurement(name, bank):
    env = HybridTrackEnv(scheme=f"L{TICKS}r5", bank=bank, **WORLDS[name])
    layout = Layout(3)
    row, info = env.reset(seed=4)
    anchor, P = info["anchor"], np.diag([0.03, 0.02] * 2)
    if bank == "published":
        filters = [MatrixKalmanFilter(anchor, np.eye(4), m, 5.0, TAU, Q, 0.1 * np.eye(2)) for m in "SLR"]
    else:
        filters = [MatrixExtendedKalmanFilter(anchor, P, r, TAU, Q, [0.1, 0.1]) for r in (0.0, 5.0, -5.0)]
    missing = 0
    for k in range(TICKS):
        z = measured(info)
        missing += z is None
        variance = 0.1 * env.world.field("variance_ratio")[0]
        for one in filters:
            one.R = variance * np.eye(2) if bank == "published" else [variance] * 2
            one.step(z)
        found = env.world.bank.hypotheses[0]
        states = [one.x if bank == "published" else one.s[:4] for one in filters]
        for h in range(3):
            np.testing.assert_allclose([found[h][n][0] for n in ("x", "vx", "y", "vy")], states[h], atol=1e-6)
        np.testing.assert_allclose(info["log_likelihood"], [one.log_likelihood for one in filters], atol=2e-5)
        along, across = (layout.read(row, f"innovation_{one}") for one in ("along", "across"))
        assert (z is None) == (not along.any() and not across.any())
        assert env.observation_space.contains(row), k
        if k < TICKS - 1:
            row, *_, info = env.step(0)
    assert 0 < missing < TICKS


@pytest.mark.parametrize("name", WORLDS)
def test_the_imm_bank_equals_matrix_filters_that_only_predict_in_a_tick_without_a_measurement(name):
    env = HybridTrackQuickestEnv(start="random", ticks=TICKS, heading=0.3, initial_error=0, **WORLDS[name])
    matrix = env.options.transition_matrix
    np.testing.assert_allclose(matrix, transition_matrix(3, env.options.assumed_hazard))
    row, info = env.reset(seed=5)
    layout = QuickestLayout(3)
    start = [0.0, 2.0 * np.cos(0.3), 0.0, 2.0 * np.sin(0.3)]
    literal = LiteralImm(start, np.zeros((4, 4)), [0.0, 0.2, -0.2], matrix, TAU, Q, [0.1, 0.1])
    missing = 0
    for k in range(TICKS):
        z = measured(info)
        missing += z is None
        literal.R = 0.1 * env.world.field("variance_ratio")[0] * np.eye(2)
        literal.step(z)
        np.testing.assert_allclose(info["estimate"], literal.estimate, atol=1e-9)
        np.testing.assert_allclose(np.exp(info["log_probability"]), literal.probability, atol=1e-9)
        np.testing.assert_allclose(env.world.field("covariance")[0][0], literal.covariance[0, 0], rtol=1e-8)
        along, across = (layout.read(row, f"innovation_{one}") for one in ("along", "across"))
        assert (z is None) == (not along.any() and not across.any())
        assert env.observation_space.contains(row), k
        row, *_, info = env.step(0)
    assert 0 < missing < TICKS


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


@pytest.mark.parametrize(
    ("length", "time"),
    [(1.0, 1.0), (1e3, 10.0), (1e-3, 1e-2), (250.0, 1.0)],
    ids=["walker", "ship", "insect", "aircraft"],
)
def test_units_change_no_row(length, time):
    options = {
        "radii": 5.0 * length, "speed": 2.0 * length / time, "tau": 0.1 * time,
        "process_variance": 0.001 * (length / time) ** 2, "measurement_variance": 0.1 * length**2,
        "initial_error": (0.3, 0.02 * (length / time) ** 2), "reset_covariance": False, "missed": 0.2,
        "noise": "student_t 3",
        "sensors": [
            {"variance": 0.2 * length**2, "period": 2},
            {"variance": 0.1 * length**2, "position": (4.0 * length, 0.0), "range": 6.0 * length},
        ],
    }  # fmt: skip
    base = HybridTrackEnv(
        reset_covariance=False, missed=0.2, noise="student_t 3",
        sensors=[Sensor(variance=0.2, period=2), Sensor(variance=0.1, position=(4.0, 0.0), range=6.0)],
    )  # fmt: skip
    scaled = HybridTrackEnv(**options)
    layout = Layout(3)
    row, other = base.reset(seed=3)[0], scaled.reset(seed=3)[0]
    for _ in range(100):
        for name in ("log_ratio", "innovation_along", "innovation_across", "displacement_along"):
            np.testing.assert_allclose(layout.read(row, name), layout.read(other, name), atol=1e-4)
        row, other = base.step(0)[0], scaled.step(0)[0]
