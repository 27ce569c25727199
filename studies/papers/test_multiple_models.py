"""Static, GPB1, IMM and GPB2 against literal matrices, and the comparison with ATE."""

import numpy as np
import pytest
from matrix_filters import transition_matrix, turn_matrix

from studies.papers import multiple_models
from studies.papers.multiple_model_filter import MultipleModels
from studies.papers.setting import TSYGANOV_2019

RADII = np.array([0.0, 2.0, 5.0, -2.0, -5.0])
TAU, Q, R = 0.3, 0.02, (0.1, 0.4)
CHAIN = transition_matrix(5, 0.1)


def kalman_step(x, P, radius, z):
    """Predict and correct in 4 x 4 matrices: estimate, covariance and likelihood."""
    F = turn_matrix(x, 1.0 / radius if radius else 0.0, TAU)
    H = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0]])
    x = F @ x
    P = F @ P @ F.T + np.diag(
        [
            0.0,
            Q,
            0.0,
            Q,
        ]
    )
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
    models = MultipleModels(
        method,
        RADII,
        Q,
        R,
        start[None],
        spread,
    )
    states, covariances, mu = np.tile(start, (5, 1)), np.tile(spread, (5, 1, 1)), np.full(5, 0.2)
    for z in np.random.default_rng(0).normal(0.0, 2.0, (12, 2)):
        models.step(z[None], TAU, CHAIN)
        states, covariances, mu = literal_step(
            method,
            states,
            covariances,
            mu,
            z,
        )
        ours = (*models.merged(), models.probabilities)
        for mine, literal in zip(ours, (*moments(mu, states, covariances), mu), strict=True):
            np.testing.assert_allclose(
                mine.reshape(literal.shape),
                literal,
                rtol=1e-8,
                atol=1e-9,
            )


def test_a_small_study_compares_every_estimator():
    result = multiple_models.reproduce(
        3,
        1,
        [TSYGANOV_2019],
        [0.1],
    )
    ours = result.cells.set_index(["table", "row", "column"]).ours
    known, unknown = (f"Tsyganov 2019, {word} moments, R = 0.1" for word in ("known", "unknown"))

    assert ours[known, "IMM", "nRMSE"] < 0.1 < ours[known, "ATE", "nRMSE"]
    steps = ours[unknown, :, "Kalman steps a tick"]
    assert steps["static"] == steps["GPB1"] == steps["IMM"] == pytest.approx(3.0)
    assert steps["GPB2"] == pytest.approx(9.0)
