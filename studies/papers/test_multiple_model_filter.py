"""Static, GPB1, IMM and GPB2 against literal matrices, against all mode histories, and in their
limits.
"""

import itertools

import numpy as np
import pytest
from matrix_filters import LiteralImm, transition_matrix, turn_matrix

from studies.papers.multiple_model_filter import MultipleModelFilter

RADII, TAU, Q, R = (2.0, 5.0), 0.3, 0.02, (0.1, 0.4)
CURVATURES = [0.0, 0.5, 0.2, -0.5, -0.2]
START = np.array([1.0, 0.5, -2.0, 1.5])
P0 = np.diag([0.5, 0.2, 0.3, 0.1]) + 0.05
CHAIN = transition_matrix(5, 0.1)


def kalman_step(x, P, curvature, z):
    """Predict and correct in 4 x 4 matrices: estimate, covariance and likelihood."""
    F = turn_matrix(x, curvature, TAU)
    H = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0]])
    x, P = F @ x, F @ P @ F.T + np.diag([0.0, Q, 0.0, Q])
    S = H @ P @ H.T + np.diag(R)
    K = P @ H.T @ np.linalg.inv(S)
    v = z - H @ x
    return (
        x + K @ v,
        P - K @ H @ P,
        np.exp(-0.5 * v @ np.linalg.solve(S, v)) / np.sqrt(np.linalg.det(2 * np.pi * S)),
    )


def moments(weights, states, covariances):
    mean = sum(w * x for w, x in zip(weights, states, strict=True))
    terms = zip(weights, states, covariances, strict=True)
    return mean, sum(w * (P + np.outer(x - mean, x - mean)) for w, x, P in terms)


def literal_step(method, states, covariances, mu, z):
    """One step of an estimator as its textbook algorithm is written, with loops over the modes."""
    M = len(mu)
    if method == "static":
        new = [kalman_step(states[j], covariances[j], CURVATURES[j], z) for j in range(M)]
        weights = [mu[j] * new[j][2] for j in range(M)]
    elif method == "gpb1":
        merged = moments(mu, states, covariances)
        new = [kalman_step(*merged, CURVATURES[j], z) for j in range(M)]
        weights = [new[j][2] * sum(CHAIN[i, j] * mu[i] for i in range(M)) for j in range(M)]
    else:
        new = []
        weights = []
        for j in range(M):
            children = [kalman_step(states[i], covariances[i], CURVATURES[j], z) for i in range(M)]
            joint = np.array([children[i][2] * CHAIN[i, j] * mu[i] for i in range(M)])
            new.append(
                moments(
                    joint / joint.sum(),
                    [one[0] for one in children],
                    [one[1] for one in children],
                )
            )
            weights.append(joint.sum())
    total = sum(weights)
    return (
        [one[0] for one in new],
        [one[1] for one in new],
        np.array(weights) / total,
        np.log(total),
    )


def begun(method, tracks=1):
    models = MultipleModelFilter(method, RADII, Q, R)
    models.transition = CHAIN
    models.begin_from(np.tile(START, (tracks, 1)), P0)
    return models


@pytest.mark.parametrize("method", ["static", "gpb1", "gpb2"])
def test_estimators_equal_their_textbook_algorithms(method):
    models = begun(method)
    measurements = np.random.default_rng(0).normal(0.0, 2.0, (12, 2))
    states = [START] * 5
    covariances = [P0] * 5
    mu = np.full(5, 0.2)
    for z in measurements:
        models.predict(TAU)
        models.update(z[None])
        states, covariances, mu, log_likelihood = literal_step(method, states, covariances, mu, z)
        mean, covariance = moments(mu, states, covariances)
        np.testing.assert_allclose(
            models.probabilities[0],
            mu,
            rtol=1e-9,
            atol=1e-12,
        )
        np.testing.assert_allclose(
            models.state[0],
            mean,
            rtol=1e-9,
            atol=1e-9,
        )
        np.testing.assert_allclose(
            models.covariance[0],
            covariance,
            rtol=1e-8,
            atol=1e-9,
        )
        assert models.log_likelihood[0] == pytest.approx(log_likelihood)


def test_imm_equals_the_literal_one_also_without_some_measurements():
    measurements = np.random.default_rng(1).normal(
        0.0,
        2.0,
        (12, 2, 2),
    )
    measurements[::3, 1] = np.nan
    models = begun("imm", 2)
    literal = [LiteralImm(START, P0, CURVATURES, CHAIN, TAU, Q, R) for _ in "ab"]
    for measured in measurements:
        models.predict(TAU)
        models.update(measured)
        for track, z in enumerate(measured):
            literal[track].step(None if np.isnan(z[0]) else z)
            np.testing.assert_allclose(
                models.state[track],
                literal[track].estimate,
                rtol=1e-9,
            )
            np.testing.assert_allclose(
                models.covariance[track],
                literal[track].covariance,
                rtol=1e-8,
                atol=1e-9,
            )
            np.testing.assert_allclose(
                models.probabilities[track],
                literal[track].probability,
                rtol=1e-9,
            )

    assert np.isnan(models.nis).tolist() == np.isnan(measured[:, 0]).tolist()


def advance(models, measurements, transitions):
    for measured, transition in zip(measurements, transitions, strict=True):
        models.transition = transition
        models.predict(TAU)
        models.update(measured[None])
    return models.state[0], models.covariance[0], models.probabilities[0]


def test_gpb2_is_the_posterior_of_all_histories_of_one_switch_and_imm_is_not():
    z = np.random.default_rng(2).normal(0.0, 1.5, (2, 2))
    joint = np.empty((5, 5))
    states = []
    covariances = []
    for i, j in itertools.product(range(5), repeat=2):
        *estimate, first = kalman_step(START, P0, CURVATURES[i], z[0])
        x, P, second = kalman_step(*estimate, CURVATURES[j], z[1])
        joint[i, j] = 0.2 * first * CHAIN[i, j] * second
        states, covariances = [*states, x], [*covariances, P]
    exact = *moments(joint.ravel() / joint.sum(), states, covariances), joint.sum(0) / joint.sum()
    gpb2, imm = (advance(begun(method), z, (None, CHAIN)) for method in ("gpb2", "imm"))
    for found, approximate, value in zip(gpb2, imm, exact, strict=True):
        np.testing.assert_allclose(found, value, rtol=1e-9, atol=1e-12)
        assert np.abs(approximate - value).max() > 1e-5


def test_without_switches_static_imm_and_gpb2_are_equal():
    z = np.random.default_rng(3).normal(0.0, 1.5, (20, 2))
    static = advance(begun("static"), z, [CHAIN] * 20)
    for method in ("imm", "gpb2"):
        for found, value in zip(
            advance(begun(method), z, [None] * 20),
            static,
            strict=True,
        ):
            np.testing.assert_array_equal(found, value)
    for found, value in zip(
        advance(begun("gpb2"), z, [np.eye(5)] * 20),
        static,
        strict=True,
    ):
        np.testing.assert_allclose(found, value, rtol=1e-9, atol=1e-12)

    assert np.abs(advance(begun("gpb1"), z, [None] * 20)[0] - static[0]).max() > 1e-3
