"""The scalar formulas of one axis agree with the matrix equations."""

import math

import numpy as np
import pytest
from scipy import stats

from hybrid_env.core.banks.kalman import correct_covariance, kalman_gain, log_likelihood, predict_covariance
from hybrid_env.core.motion import motion_coefficients


@pytest.mark.parametrize("rate", [0.0, 0.4, 5.0])
def test_one_tick_of_the_covariance_equals_the_matrix_equations(rate):
    tau, Q, R = 0.1, 0.3, 0.05
    coefficients = cosine, sine_velocity, sine_position = motion_coefficients(rate, tau)
    P = np.array([[0.7, 0.2], [0.2, 1.1]])
    Phi, H = np.array([[cosine, sine_velocity], [-sine_position, cosine]]), np.array([[1.0, 0.0]])
    predicted = Phi @ P @ Phi.T + np.diag([0.0, Q])
    Sigma = H @ predicted @ H.T + R
    K = predicted @ H.T / Sigma
    corrected = predicted - K @ H @ predicted

    triangle = predict_covariance((0.7, 0.2, 1.1), *coefficients, Q)
    np.testing.assert_allclose(triangle, predicted[np.triu_indices(2)], rtol=1e-14)
    gain = kalman_gain(triangle, triangle[0] + R)
    np.testing.assert_allclose(gain, K[:, 0], rtol=1e-14)
    np.testing.assert_allclose(correct_covariance(triangle, *gain, R), corrected[np.triu_indices(2)], rtol=1e-12)


def test_the_log_likelihood_equals_that_of_a_normal_innovation():
    deviation = np.array([0.3, 2.0])
    innovation = np.array([-0.2, 3.0])
    expected = stats.norm.logpdf(innovation, scale=deviation).sum()
    white = innovation / deviation
    found = log_likelihood(white[0], white[1], float(np.log(deviation**2).mean()))
    assert math.isclose(found, expected, rel_tol=1e-14)


@pytest.mark.parametrize("rate", [0.0, 1e-6, 0.3])
@pytest.mark.parametrize("tau", [0.1, 1e4, 1e9])
def test_a_covariance_much_larger_than_the_noise_stays_positive_semidefinite(tau, rate):
    # the corrected velocity variance is smaller than the rounding error of the predicted one
    coefficients = motion_coefficients(rate / tau, tau)
    for R in (1e-18, 1e-6, 1.0):
        covariance = (1.0, 0.0, 1.0)
        for _ in range(1000):
            predicted = predict_covariance(covariance, *coefficients, 0.0)
            Sigma = predicted[0] + R
            assert Sigma >= R * (1 - 1e-9)
            covariance = correct_covariance(predicted, *kalman_gain(predicted, Sigma), R)
            assert covariance[0] >= 0.0
            assert covariance[2] >= 0.0
