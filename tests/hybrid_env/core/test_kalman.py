"""The scalar formulas of one axis where covariances are far larger than the noise."""

import pytest

from hybrid_env.core.banks.kalman import correct_covariance, kalman_gain, predict_covariance
from hybrid_env.core.motion import motion_coefficients


@pytest.mark.parametrize("rate", [0.0, 1e-6, 0.3])
@pytest.mark.parametrize("tau", [0.1, 1e4, 1e9])
def test_a_covariance_much_larger_than_the_noise_stays_positive_semidefinite(tau, rate):
    # The corrected velocity variance is smaller than the rounding error of the predicted one.
    coefficients = motion_coefficients(rate / tau, tau)
    for R in (1e-18, 1e-6, 1.0):
        covariance = (1.0, 0.0, 1.0)
        for _ in range(1000):
            predicted = predict_covariance(covariance, *coefficients, 0.0)
            Sigma = predicted[0] + R
            assert Sigma >= R * (1 - 1e-9)
            covariance = correct_covariance(
                predicted,
                *kalman_gain(predicted, Sigma),
                R,
            )
            assert covariance[0] >= 0.0
            assert covariance[2] >= 0.0
