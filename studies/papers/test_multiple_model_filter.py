"""Static, GPB1, IMM and GPB2 against literal matrices, against all mode histories, and in their
limits.
"""

import itertools

import numpy as np
import pytest
from matrix_filters import LiteralImm, transition_matrix, turn_matrix

from studies.papers.multiple_model_filter import MultipleModels

RADII = (2.0, 5.0)
TAU = 0.3
Q = 0.02
R = (0.1, 0.4)
CURVATURES = [0.0, 0.5, 0.2, -0.5, -0.2]
START = np.array([1.0, 0.5, -2.0, 1.5])
P0 = np.diag([0.5, 0.2, 0.3, 0.1]) + 0.05
CHAIN = transition_matrix(5, 0.1)
MODES = range(5)


def kalman_step(
    x,
    P,
    curvature,
    z,
):
    """Predict and correct in 4 x 4 matrices: estimate, covariance and likelihood."""
    F = turn_matrix(x, curvature, TAU)
    H = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0]])
    x = F @ x
    P = F @ P @ F.T + np.diag([0.0, Q, 0.0, Q])
    S = H @ P @ H.T + np.diag(R)
    K = P @ H.T @ np.linalg.inv(S)
    v = z - H @ x
    density = np.exp(-0.5 * v @ np.linalg.solve(S, v)) / np.sqrt(np.linalg.det(2 * np.pi * S))
    return x + K @ v, P - K @ H @ P, density


def moments(
    weights,
    states,
    covariances,
):
    mean = sum(w * x for w, x in zip(weights, states, strict=True))
    terms = zip(weights, states, covariances, strict=True)
    return mean, sum(w * (P + np.outer(x - mean, x - mean)) for w, x, P in terms)


def literal_step(
    method,
    states,
    covariances,
    mu,
    z,
):
    """One step of an estimator as its textbook algorithm is written, with loops over the modes."""
    found = []
    weights = []
    for j in MODES:
        if method == "static":
            *estimate, likelihood = kalman_step(
                states[j],
                covariances[j],
                CURVATURES[j],
                z,
            )
            weights.append(mu[j] * likelihood)
        elif method == "gpb1":
            merged = moments(mu, states, covariances)
            *estimate, likelihood = kalman_step(
                *merged,
                CURVATURES[j],
                z,
            )
            weights.append(likelihood * (mu @ CHAIN[:, j]))
        else:
            children = [kalman_step(states[i], covariances[i], CURVATURES[j], z) for i in MODES]
            children_states, children_covariances, likelihoods = zip(*children, strict=True)
            joint = likelihoods * CHAIN[:, j] * mu
            estimate = moments(joint / joint.sum(), children_states, children_covariances)
            weights.append(joint.sum())
        found.append(estimate)
    states, covariances = zip(*found, strict=True)
    return states, covariances, np.array(weights) / sum(weights)


def begun(method, tracks=1):
    return MultipleModels(
        method,
        RADII,
        Q,
        R,
        np.tile(START, (tracks, 1)),
        P0,
    )


def advance(
    models,
    measurements,
    transitions,
):
    for measured, transition in zip(measurements, transitions, strict=True):
        models.step(measured[None], TAU, transition)
    state, covariance = models.merged()
    return state[0], covariance[0], models.probabilities[0]


@pytest.mark.parametrize("method", ["static", "gpb1", "gpb2"])
def test_estimators_equal_their_textbook_algorithms(method):
    models = begun(method)
    states = [START] * 5
    covariances = [P0] * 5
    mu = np.full(5, 0.2)
    for z in np.random.default_rng(0).normal(0.0, 2.0, (12, 2)):
        found = advance(models, [z], [CHAIN])
        states, covariances, mu = literal_step(
            method,
            states,
            covariances,
            mu,
            z,
        )
        expected = *moments(mu, states, covariances), mu
        for mine, other in zip(found, expected, strict=True):
            np.testing.assert_allclose(mine, other, rtol=1e-8, atol=1e-9)


def test_imm_equals_the_literal_one():
    models = begun("imm", 2)
    literal = [LiteralImm(START, P0, CURVATURES, CHAIN, TAU, Q, R) for _ in "ab"]
    for measured in np.random.default_rng(1).normal(0.0, 2.0, (12, 2, 2)):
        models.step(measured, TAU, CHAIN)
        state, covariance = models.merged()
        for track, z in enumerate(measured):
            other = literal[track]
            other.step(z)
            np.testing.assert_allclose(
                state[track],
                other.estimate,
                rtol=1e-9,
            )
            np.testing.assert_allclose(
                covariance[track],
                other.covariance,
                rtol=1e-8,
                atol=1e-9,
            )
            probabilities = models.probabilities[track]
            np.testing.assert_allclose(probabilities, other.probability, rtol=1e-9)


def test_gpb2_is_the_posterior_of_all_histories_of_one_switch_and_imm_is_not():
    z = np.random.default_rng(2).normal(
        0.0,
        1.5,
        (2, 2),
    )
    joint = np.empty((5, 5))
    states = []
    covariances = []
    for i, j in itertools.product(MODES, repeat=2):
        *estimate, first = kalman_step(
            START,
            P0,
            CURVATURES[i],
            z[0],
        )
        x, P, second = kalman_step(
            *estimate,
            CURVATURES[j],
            z[1],
        )
        joint[i, j] = 0.2 * first * CHAIN[i, j] * second
        states.append(x)
        covariances.append(P)
    posterior = joint / joint.sum()
    exact = *moments(posterior.ravel(), states, covariances), posterior.sum(0)
    gpb2, imm = (advance(begun(method), z, (None, CHAIN)) for method in ("gpb2", "imm"))
    for found, approximate, value in zip(gpb2, imm, exact, strict=True):
        np.testing.assert_allclose(found, value, rtol=1e-9, atol=1e-12)
        assert np.abs(approximate - value).max() > 1e-5


def test_without_switches_static_imm_and_gpb2_are_equal_and_gpb1_is_not():
    z = np.random.default_rng(3).normal(
        0.0,
        1.5,
        (20, 2),
    )
    static = advance(
        begun("static"),
        z,
        [CHAIN] * 20,
    )
    for method in ("imm", "gpb2"):
        found = advance(
            begun(method),
            z,
            [None] * 20,
        )
        for mine, other in zip(found, static, strict=True):
            np.testing.assert_array_equal(mine, other)

    assert np.abs(advance(begun("gpb1"), z, [None] * 20)[0] - static[0]).max() > 1e-3
