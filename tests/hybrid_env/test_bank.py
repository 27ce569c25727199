"""The bank equals the joint normal law of all measurements; its filters in matrix form:
`core/test_banks`.
"""

import copy
import math
import pickle

import numpy as np
import pytest

from hybrid_env import KalmanBank


def test_log_likelihood_equals_that_of_the_joint_normal_distribution_of_all_measurements():
    # No recursion: z_1 .. z_n of a straight track are jointly normal.
    tau = 0.1
    Q = 0.01
    R = 0.2
    n = 12
    start = np.array([0.3, 1.0, -0.2, 0.4])
    F = np.array([[1, tau], [0, 1.0]])
    H = np.array([1.0, 0.0])
    means = np.array([np.linalg.matrix_power(F, k + 1) for k in range(n)])
    joint = R * np.eye(n)
    for i in range(n):
        for j in range(n):
            joint[i, j] += H @ means[i] @ means[j].T @ H
            for k in range(min(i, j) + 1):
                A = np.linalg.matrix_power(F, i - k)
                B = np.linalg.matrix_power(F, j - k)
                joint[i, j] += Q * (A[0, 1] * B[0, 1])
    z = np.random.default_rng(3).normal(0, 1, (n, 2))
    bank = KalmanBank([5.0], tau, Q, R)
    bank.anchor(start)
    for row in z:
        log_likelihood = bank.step(row)
    expected = 0.0
    for axis in (0, 1):
        error = z[:, axis] - means[:, 0] @ start[2 * axis : 2 * axis + 2]
        expected -= 0.5 * (
            error @ np.linalg.solve(joint, error)
            + np.linalg.slogdet(joint)[1]
            + n * math.log(2 * math.pi)
        )

    assert log_likelihood[0] == pytest.approx(expected, rel=1e-12)


def test_an_anchor_at_rest_gives_finite_log_likelihoods():
    bank = KalmanBank([1.0, 5.0])
    bank.anchor([0.0, 0.0, 0.0, 0.0])
    for _ in range(50):
        assert np.isfinite(bank.step([0.1, -0.1])).all()


@pytest.mark.parametrize("bank", ["published", "anchor_aware"])
@pytest.mark.parametrize(
    "missing",
    [[np.nan, np.nan], [0.3, np.nan], (np.nan, 0.3)],
)
def test_a_measurement_with_nan_only_predicts(bank, missing):
    bank = KalmanBank([2.0, 9.0], bank=bank)
    bank.anchor([0.0, 1.0, 0.0, 0.5])
    before = bank.step([0.2, 0.1])
    start, covariances = bank.estimates, bank.covariances

    np.testing.assert_array_equal(bank.step(missing), before)
    assert np.isnan(bank.innovations).all()
    np.testing.assert_allclose(
        bank.estimates[0],
        start[0] + 0.1 * start[0, [1, 1, 3, 3]] * [1, 0, 1, 0],
    )
    assert (bank.covariances[:, [0, 2], [0, 2]] > covariances[:, [0, 2], [0, 2]]).all()
    expected = bank.covariances[:, ::2, ::2] + 0.1 * np.eye(2)
    np.testing.assert_allclose(
        bank.innovation_covariances,
        expected,
        rtol=1e-14,
    )


@pytest.mark.parametrize("bank", ["published", "anchor_aware"])
def test_an_anchor_of_three_numbers_is_that_of_a_matrix(bank):
    first = KalmanBank(bank=bank)
    second = KalmanBank(bank=bank)
    axis = [[0.3, 0.02], [0.02, 0.1]]
    first.anchor([0.0, 1.0, 0.0, 0.5], (0.3, 0.02, 0.1))
    second.anchor(
        [0.0, 1.0, 0.0, 0.5],
        np.kron(np.eye(2), axis),
    )

    np.testing.assert_array_equal(
        first.covariances[0],
        np.kron(np.eye(2), axis),
    )
    np.testing.assert_array_equal(
        first.step([0.1, 0.2]),
        second.step([0.1, 0.2]),
    )


@pytest.mark.parametrize("bank", ["published", "anchor_aware"])
@pytest.mark.parametrize(
    "copied",
    [copy.deepcopy, lambda bank: pickle.loads(pickle.dumps(bank))],
)
def test_a_copy_of_a_bank_continues_alike_in_memory_of_its_own(bank, copied):
    bank = KalmanBank([2.0, 9.0], bank=bank)
    bank.anchor([0.0, 1.0, 0.0, 0.5])
    bank.step([0.1, 0.2])
    other = copied(bank)
    before = bank.estimates
    expected = other.step([0.3, 0.4])

    np.testing.assert_array_equal(bank.estimates, before)
    np.testing.assert_array_equal(bank.step([0.3, 0.4]), expected)
    np.testing.assert_array_equal(bank.covariances, other.covariances)


def test_step_before_anchor_raises():
    with pytest.raises(RuntimeError, match="anchor"):
        KalmanBank().step([0.0, 0.0])
