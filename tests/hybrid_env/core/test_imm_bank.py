"""The compiled IMM bank agrees with a literal one in matrix form, and is finite for extreme options."""

import itertools
import math

import numpy as np
import pytest
from matrix_filters import LiteralImm, transition_matrix

from hybrid_env import HybridTrackQuickestEnv, HybridTrackQuickestVectorEnv
from hybrid_env.core.banks.bank import bank_arrays
from hybrid_env.core.banks.imm import ImmBank, ImmModel, begin_imm, step_imm
from hybrid_env.core.compilation import compiled
from hybrid_env.core.records import BLOCK, LANES

TRIANGLE = np.triu_indices(4)
begin, step = compiled(begin_imm), compiled(step_imm)


def test_the_bank_equals_the_literal_one_in_every_lane():
    generator = np.random.default_rng(3)
    radii = np.array([2.0, 9.0])
    curvatures = [0.0, *1 / radii, *-1 / radii]
    bank = bank_arrays(ImmBank, radii.size)
    for hazard in (0.0, 0.01, 0.3, 0.8):
        tau, Q = generator.uniform(0.05, 0.2), 10.0 ** generator.uniform(-4, -1)
        R = 10.0 ** generator.uniform(-2, 0, 2)
        model = ImmModel(tau, Q, R[0], R[1], 1 - hazard, hazard / 4)
        block = np.zeros(1, BLOCK)[0]
        literal = []
        for lane in range(LANES):
            estimate = generator.normal(0, [50, 2, 50, 2])
            root = 0.3 * generator.normal(0, 1, (4, 4))
            P = root @ root.T
            block["estimate"][:, lane], block["covariance"][:, lane] = estimate, P[TRIANGLE]
            begin(bank, block, lane, -1)
            transition = transition_matrix(5, hazard)
            literal.append(LiteralImm(estimate, P, curvatures, transition, tau, Q, R))
        position = block["estimate"][[0, 2]].copy()
        velocity = block["estimate"][[1, 3]].copy()
        for _ in range(25):
            position += tau * velocity
            z = position + generator.normal(0, np.sqrt(R)[:, None], (2, LANES))
            block["measurement"] = z
            step(bank, block, 0, LANES, radii, model)
            for lane, one in enumerate(literal):
                one.step(z[:, lane])
        for lane, one in enumerate(literal):
            for h in range(5):
                record = bank.hypotheses[h]
                found = [record[name][lane] for name in ("x", "vx", "y", "vy")]
                np.testing.assert_allclose(found, one.states[h], rtol=1e-9, atol=1e-9)
                np.testing.assert_allclose(
                    record["covariance"][:, lane], one.covariances[h][TRIANGLE], rtol=1e-8, atol=1e-11
                )
                np.testing.assert_allclose(record["log_likelihood"][lane], one.log_likelihood[h], rtol=1e-9)
            found = np.exp(bank.hypotheses["log_probability"][:, lane])
            np.testing.assert_allclose(found, one.probability, rtol=1e-8, atol=1e-12)
            np.testing.assert_allclose(block["estimate"][:, lane], one.estimate, rtol=1e-9)
            np.testing.assert_allclose(
                block["covariance"][:, lane], one.covariance[TRIANGLE], rtol=1e-8, atol=1e-10
            )


@pytest.mark.parametrize("hazard", [0.0, 1 / 75])
def test_the_environment_steps_the_literal_bank(hazard):
    R = (0.1, 0.3)
    env = HybridTrackQuickestEnv(
        measurement_variance=R,
        initial_error=0,
        hazard=hazard,
        heading=0.3,
        ticks=80,
        durations="uniform 9-30",
        start="random",
    )
    np.testing.assert_allclose(env.options.transition_matrix, transition_matrix(3, hazard))
    _, info = env.reset(seed=5)
    start = [0.0, 2.0 * math.cos(0.3), 0.0, 2.0 * math.sin(0.3)]
    literal = LiteralImm(
        start, np.zeros((4, 4)), [0.0, 0.2, -0.2], env.options.transition_matrix, 0.1, 0.001, R
    )
    switches = 0
    for _ in range(80):
        literal.step(info["measurement"])
        np.testing.assert_allclose(np.exp(info["log_probability"]), literal.probability, atol=1e-9)
        np.testing.assert_allclose(info["estimate"], literal.estimate, rtol=1e-9, atol=1e-12)
        _, _, _, _, info = env.step(0)
        switches += info["tick"] == 1
    assert switches >= 2


def test_probabilities_equal_enumeration_where_mixing_is_exact():
    # an object at rest, whose filters agree in all modes: only the transition matrix moves the probabilities
    model = ImmModel(0.1, 0.0, 0.5, 0.5, 0.9, 0.05)
    radii, bank = np.array([3.0]), bank_arrays(ImmBank, 1)
    block = np.zeros(1, BLOCK)[0]
    begin(bank, block, 0, -1)
    bank.hypotheses["log_probability"][:, 0] = np.log([0.7, 0.2, 0.1])
    histories = dict(zip(((0,), (1,), (2,)), (0.7, 0.2, 0.1), strict=True))
    generator = np.random.default_rng(1)
    for _ in range(6):
        block["measurement"][:, 0] = generator.normal(0, 0.7, 2)
        step(bank, block, 0, 1, radii, model)
        histories = {
            (*history, mode): probability * (0.9 if mode == history[-1] else 0.05)
            for (history, probability), mode in itertools.product(histories.items(), range(3))
        }
        total = [sum(p for history, p in histories.items() if history[-1] == mode) for mode in range(3)]
        found = np.exp(bank.hypotheses["log_probability"][:, 0])
        np.testing.assert_allclose(found, total, rtol=0, atol=1e-10)


def test_without_switches_probabilities_equal_those_of_all_constant_histories():
    env = HybridTrackQuickestVectorEnv(4, hazard=0.0, ticks=12, start="random")
    _, info = env.reset(seed=2)
    total = np.zeros((4, 3))
    for _ in range(12):
        likelihood = env.world.bank.hypotheses["log_likelihood"][0].T[:4]
        total += likelihood
        expected = np.exp(total - total.max(1, keepdims=True))
        expected /= expected.sum(1, keepdims=True)
        np.testing.assert_allclose(np.exp(info["log_probability"]), expected, rtol=0, atol=1e-10)
        *_, info = env.step(np.zeros(4, np.int64))


@pytest.mark.parametrize("sigmas", [100.0, 1e5])
def test_probabilities_and_estimates_are_finite_after_outliers(sigmas):
    model = ImmModel(0.1, 0.001, 0.1, 0.1, 1 - 1 / 75, 1 / 150)
    radii, bank = np.array([5.0]), bank_arrays(ImmBank, 1)
    block = np.zeros(1, BLOCK)[0]
    block["estimate"][1], block["covariance"][[0, 4, 7, 9]] = 2.0, 0.02
    for lane in range(LANES):
        begin(bank, block, lane, -1)
    generator = np.random.default_rng(0)
    for k in range(200):
        scale = sigmas if k % 10 == 5 else 1.0
        block["measurement"] = generator.normal(0, scale * math.sqrt(0.1), (2, LANES))
        step(bank, block, 0, LANES, radii, model)
        log_probability = bank.hypotheses["log_probability"]
        assert np.isfinite(log_probability).all()
        np.testing.assert_allclose(np.exp(log_probability).sum(0), 1, rtol=1e-12)
        assert np.isfinite(block["estimate"]).all()
        assert (block["covariance"][[0, 4, 7, 9]] > 0).all()


EXTREME = [
    {"speed": 1e9, "radii": (1e12,), "measurement_variance": 1e18},
    {"speed": 1e-9, "tau": 1e-9, "measurement_variance": 1e-18, "radii": (1e-12, 1e-6)},
    {"speed": 300.0, "radii": (1.0,), "measurement_variance": 1e-9},
    {"process_variance": 1e18, "measurement_variance": 1e18, "tau": 1e-9},
    {"process_variance": 0.0, "initial_error": 0, "measurement_variance": (1e-6, 1e3)},
    {"noise": "outliers 0.9", "measurement_variance": (1e3, 1e-3)},
    {"hazard": 0.0, "noise": "outliers 0.3"},
    {"hazard": 2 / 3},
]


@pytest.mark.parametrize("options", EXTREME, ids=str)
def test_extreme_options_give_finite_rows_inside_the_space(options):
    env = HybridTrackQuickestVectorEnv(LANES + 1, **options)
    rows, _ = env.reset(seed=1)
    for k in range(700):
        assert env.observation_space.contains(rows), k
        rows, rewards, *_ = env.step(np.full(LANES + 1, k % 3))
        assert np.isfinite(rewards).all()
