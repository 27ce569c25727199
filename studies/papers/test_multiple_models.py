"""Static, GPB1, IMM and GPB2 against literal matrices, ATE with P kept against the package, and the
comparison of all.
"""

import numpy as np
import pytest
from matrix_filters import transition_matrix, turn_matrix

from baselines import Scores
from hybrid_env import KalmanBank
from studies.papers import multiple_models
from studies.papers.anchored_ate import AnchoredFilters, anchored_ate
from studies.papers.multiple_model_filter import MultipleModels
from studies.papers.setting import GOLUBKOV_2018, TSYGANOV_2019

RADII = np.array([0.0, 2.0, 5.0, -2.0, -5.0])
TAU, Q, R = 0.3, 0.02, (0.1, 0.4)
CHAIN = transition_matrix(5, 0.1)


def kalman_step(x, P, radius, z):
    """Predict and correct in 4 x 4 matrices: estimate, covariance and likelihood."""
    F = turn_matrix(x, 1.0 / radius if radius else 0.0, TAU)
    H = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0]])
    x = F @ x
    P = F @ P @ F.T + np.diag([0.0, Q, 0.0, Q])
    S = H @ P @ H.T + np.diag(R)
    K = P @ H.T @ np.linalg.inv(S)
    v = z - H @ x
    density = np.exp(-0.5 * v @ np.linalg.solve(S, v)) / np.sqrt(np.linalg.det(2 * np.pi * S))
    return x + K @ v, P - K @ H @ P, density


def moments(weights, states, covariances):
    weights = weights / weights.sum()
    mean = weights @ states
    spread = states - mean
    return mean, np.einsum("k,kij->ij", weights, covariances) + (spread.T * weights) @ spread


def literal_step(method, states, covariances, mu, z):
    """One step of an estimator as its textbook algorithm is written, with loops over the modes."""
    merged = []
    weights = []
    for j, radius in enumerate(RADII):
        # Estimates from which the filters of the mode start, and their probabilities.
        shares = mu * CHAIN[:, j]
        before = zip(states, covariances, strict=True)
        if method == "static":
            before, shares = [(states[j], covariances[j])], mu[j : j + 1]
        elif method in ("gpb1", "imm"):
            mixed = mu if method == "gpb1" else shares
            before, shares = [moments(mixed, states, covariances)], shares.sum(keepdims=True)
        children = [kalman_step(*estimate, radius, z) for estimate in before]
        children = [np.array(values) for values in zip(*children, strict=True)]
        joint = shares * children.pop()
        merged.append(moments(joint, *children))
        weights.append(joint.sum())
    return *map(np.array, zip(*merged, strict=True)), np.array(weights) / sum(weights)


@pytest.mark.parametrize("method", ["static", "gpb1", "imm", "gpb2"])
def test_estimators_equal_their_textbook_algorithms(method):
    start = np.array([1.0, 0.5, -2.0, 1.5])
    spread = np.diag([0.5, 0.2, 0.3, 0.1]) + 0.05
    models = MultipleModels(method, RADII, Q, R, start[None], spread)
    states, covariances, mu = np.tile(start, (5, 1)), np.tile(spread, (5, 1, 1)), np.full(5, 0.2)
    for z in np.random.default_rng(0).normal(0.0, 2.0, (12, 2)):
        models.step(z[None], TAU, CHAIN)
        states, covariances, mu = literal_step(method, states, covariances, mu, z)
        ours = (*models.merged(), models.probabilities)
        for mine, literal in zip(ours, (*moments(mu, states, covariances), mu), strict=True):
            np.testing.assert_allclose(mine.reshape(literal.shape), literal, rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize("bank", ["published", "anchor_aware"])
def test_anchored_filters_equal_the_bank_of_the_package(bank):
    anchor, P = np.array([0.3, 0.5, 1.0, 2.0]), np.diag([0.3, 0.2, 0.4, 0.1]) + 0.05
    if bank == "published":
        # Which filters each axis by itself.
        P = P * np.kron(np.eye(2), np.ones((2, 2)))
    ours = AnchoredFilters(GOLUBKOV_2018, 0.1, bank == "published")
    ours.begin(anchor[None], P[None])
    theirs = KalmanBank(GOLUBKOV_2018.radii, measurement_variance=0.1, bank=bank)
    theirs.anchor(anchor, P)
    for z in GOLUBKOV_2018.simulate(1, 4, 0.1).measurements[0, :40]:
        ours.step(z[None])
        likelihood = theirs.step(z)

    differences = ours.log_likelihood[0] - ours.log_likelihood[0, 0]
    np.testing.assert_allclose(differences, likelihood - likelihood[0], atol=1e-9)
    np.testing.assert_allclose(ours.states[0, :, :4], theirs.estimates, atol=1e-11)
    np.testing.assert_allclose(ours.covariances[0, :, :4, :4], theirs.covariances, atol=1e-11)


def test_a_recalculated_segment_is_that_of_the_decided_filter_from_the_switch_on():
    recording = TSYGANOV_2019.simulate(3, 5, 0.1)
    estimates, decided, _ = anchored_ate(recording, TSYGANOV_2019, 0.1, True)
    bank = KalmanBank(TSYGANOV_2019.radii, process_variance=0.0, measurement_variance=0.1)
    for run, mode in enumerate(decided[:, 0]):
        bank.anchor(TSYGANOV_2019.start)
        for k in range(recording.lengths[0]):
            bank.step(recording.measurements[run, k])
            np.testing.assert_allclose(estimates[run, k], bank.estimates[mode], atol=1e-9)


def test_a_statement_waits_until_other_types_are_improbable():
    probabilities = np.array([[0.5, 0.3, 0.2], [0.1, 0.6, 0.3], [0.0, 0.9, 0.1], [0.2, 0.3, 0.5]])
    stated = multiple_models.stated_above(probabilities[None], 0.15)

    assert stated.tolist() == [[0, 0, 1, 1]]
    assert multiple_models.stated_above(probabilities[None], 1.0).tolist() == [[0, 1, 1, -1]]


def test_delays_are_compared_where_wrong_changes_are_equal():
    def scores(wrong, delay):
        names = "wrong changes in 1,000 ticks", "delay, ticks"
        return Scores("", "", (0.0,), names, np.tile([wrong, delay], (8, 1))[..., None])

    curve = [scores(*point) for point in ((10.0, 4.0), (6.0, 5.0), (2.0, 9.0))]
    value, low, high = multiple_models.at_equal_wrong_changes(scores(3.0, 20.0), curve, 0)
    # A quarter of the way from 2 to 6 wrong changes.
    assert value == pytest.approx([3.0, 20.0, 8.0, -12.0])
    assert low == pytest.approx(value)
    assert high == pytest.approx(value)
    fewer, *_ = multiple_models.at_equal_wrong_changes(scores(1.0, 20.0), curve, 0)
    assert np.isnan(fewer[2:]).all()


def test_a_small_study_compares_every_estimator():
    result = multiple_models.reproduce(3, 1, [TSYGANOV_2019], [0.1])
    ours = result.cells.set_index(["table", "row", "column"]).ours
    known, unknown = (f"Tsyganov 2019, {word} moments, R = 0.1" for word in ("known", "unknown"))

    assert ours[known, "IMM", "nRMSE"] < 0.1 < ours[known, "ATE", "nRMSE"]
    steps = ours[unknown, :, "Kalman steps a tick"]
    assert steps["static"] == steps["GPB1"] == steps["IMM"] == pytest.approx(3.0)
    assert steps["GPB2"] == pytest.approx(9.0)
