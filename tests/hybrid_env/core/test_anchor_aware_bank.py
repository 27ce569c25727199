"""The anchor-aware bank agrees with matrix filters of seven states, and is finite for extreme options."""

import itertools

import gymnasium as gym
import numpy as np
import pytest
from matrix_filters import MatrixExtendedKalmanFilter

from hybrid_env import HybridTrackEnv, HybridTrackVectorEnv, Layout
from hybrid_env.core.banks.anchor_aware import AnchorAwareBank, begin_aware, covariance_aware, step_aware
from hybrid_env.core.banks.bank import FilterModel, bank_arrays
from hybrid_env.core.compilation import compiled
from hybrid_env.core.records import LANES

TRIANGLE = np.triu_indices(4)
begin, step, covariance = compiled(begin_aware), compiled(step_aware), compiled(covariance_aware)


def test_the_bank_equals_matrix_filters_in_every_lane():
    generator = np.random.default_rng(7)
    radii = np.array([2.0, 9.0, 200.0])
    signed = [0.0, *radii, *-radii]
    bank = bank_arrays(AnchorAwareBank, radii.size, 2)
    for _ in range(20):
        tau, Q = generator.uniform(0.05, 0.2), 10.0 ** generator.uniform(-4, -2)
        R = 10.0 ** generator.uniform(-2, 0, 2)
        model = FilterModel(tau, Q, R[0], R[1])
        reference = []
        anchors = generator.normal(0, [3, 2, 3, 2], (LANES, 4))
        anchors[:, [1, 3]] += np.sign(anchors[:, [1, 3]])  # away from rest, where derivatives diverge
        for lane, anchor in enumerate(anchors):
            root = 0.1 * generator.normal(0, 1, (4, 4))
            P = root @ root.T
            begin(bank, lane, tuple(anchor), tuple(P[TRIANGLE]), radii, model)
            reference.append([MatrixExtendedKalmanFilter(anchor, P, radius, tau, Q, R) for radius in signed])
        position = anchors[:, [0, 2]].copy()
        for _ in range(15):
            position += tau * anchors[:, [1, 3]]
            z = position + generator.normal(0, np.sqrt(R), (LANES, 2))
            step(bank, 0, LANES, z.T.copy(), model)
            for lane in range(LANES):
                for one in reference[lane]:
                    one.step(z[lane])
        for lane in range(LANES):
            for h, one in enumerate(reference[lane]):
                record = bank.hypotheses[h]
                found = [record[name][lane] for name in ("x", "vx", "y", "vy")]
                np.testing.assert_allclose(found, one.s[:4], rtol=1e-6, atol=1e-7)
                if h:
                    np.testing.assert_allclose(record["turn_rate"][lane], one.s[6], rtol=1e-6)
                np.testing.assert_allclose(record["log_likelihood"][lane], one.log_likelihood, rtol=1e-6)
                np.testing.assert_allclose(
                    covariance(bank, h, lane), one.P[:4, :4][TRIANGLE], rtol=1e-5, atol=1e-9
                )


def test_the_environment_carries_over_the_covariance_of_the_chosen_filter_at_the_switch():
    R = (0.1, 0.2)
    env = HybridTrackEnv(
        bank="anchor_aware", scheme="L30r5 S20", measurement_variance=R, render_mode="rgb_array"
    )
    _, info = env.reset(seed=4)
    P = np.diag([0.3 * R[0], 0.02, 0.3 * R[1], 0.02])
    reference = [
        MatrixExtendedKalmanFilter(info["anchor"], P, radius, 0.1, 0.001, R) for radius in (0.0, 5.0, -5.0)
    ]
    for k in range(12):
        for one in reference:
            one.step(info["measurement"])
        np.testing.assert_allclose(
            info["log_likelihood"], [one.log_likelihood for one in reference], rtol=1e-6, atol=1e-6
        )
        if k < 11:
            _, _, _, _, info = env.step(0)
    row, _, _, _, info = env.step(2)  # left, the true mode
    chosen = reference[1]
    for z in env.world.read_trace(0)[:-1, 4:6]:
        chosen.step(z)
    np.testing.assert_allclose(info["anchor"], chosen.s[:4], rtol=1e-6, atol=1e-7)
    mean = [
        0.5 * (chosen.P[a, b] / R[0] + chosen.P[a + 2, b + 2] / R[1]) for a, b in ((0, 0), (0, 1), (1, 1))
    ]
    layout = Layout(3)
    found = [layout.read(row, name) for name in ("anchor_xx", "anchor_xv", "anchor_vv")]
    np.testing.assert_allclose(found, mean, rtol=1e-5)
    after = [
        MatrixExtendedKalmanFilter(info["anchor"], chosen.P[:4, :4], radius, 0.1, 0.001, R)
        for radius in (0.0, 5.0)
    ]
    for one in after:
        one.step(info["measurement"])
    np.testing.assert_allclose(info["log_likelihood"][:2], [one.log_likelihood for one in after], rtol=1e-5)


def test_the_oracle_bank_is_anchored_at_the_true_state():
    env = HybridTrackEnv(bank="oracle", scheme="L30r5 S20", heading=0.5)
    _, info = env.reset(seed=4)
    np.testing.assert_allclose(info["anchor"], [0, 2 * np.cos(0.5), 0, 2 * np.sin(0.5)], atol=1e-15)
    _, _, _, _, info = env.step(3)  # a wrong decision does not change the next anchor
    assert not info["correct"]
    assert np.hypot(*(info["anchor"] - info["truth"])[[0, 2]]) < 0.3


@pytest.mark.parametrize("tracks", [5, 16])
def test_vector_tracks_equal_single_environments_bit_for_bit(tracks):
    options = {"bank": "anchor_aware", "scheme": "random 3x5-15"}
    vector = gym.make_vec("HybridTrack-v0", tracks, **options)
    singles = [gym.make("HybridTrack-v0", **options).unwrapped for _ in range(tracks)]
    rows, _ = vector.reset(seed=11)
    for i, single in enumerate(singles):
        assert single.reset(seed=11 + i)[0].tobytes() == rows[i].tobytes()
    restart = np.zeros(tracks, bool)
    generator = np.random.default_rng(0)
    for _ in range(150):
        actions = np.where(generator.random(tracks) < 0.9, 0, generator.integers(0, 4, tracks))
        rows, _, terminated, _, _ = vector.step(actions)
        for i, single in enumerate(singles):
            row = single.reset()[0] if restart[i] else single.step(actions[i])[0]
            assert row.tobytes() == rows[i].tobytes()
        restart = terminated


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
    bank = bank_arrays(AnchorAwareBank, 1, 1)
    model = FilterModel(0.1, 0.001, 0.1, 0.1)
    covariance = tuple(0.1 * np.eye(4)[TRIANGLE])
    begin(bank, 0, (0.0, 1.0, 0.0, 0.0), covariance, np.array([5.0]), model)
    bank.hypotheses[1]["covariance"][0, 0] = np.nan
    bank.hypotheses[2]["covariance"][0, 0] = -1.0
    z = np.zeros((2, LANES))
    z[0] = 0.1
    for _ in range(5):
        step(bank, 0, LANES, z, model)
    found = bank.hypotheses["log_likelihood"][:, 0]
    assert np.isfinite(found).all()
    assert found[0] > max(found[1:]) + 1000
    assert np.isfinite(bank.hypotheses["x"][:, 0]).all()


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
