"""Particles equal the Kalman filter where it is exact; correntropy with a wide kernel does too."""

import numpy as np
import pytest

from baselines.estimation.correction import Correntropy, gaussian_factors
from baselines.estimation.kalman import KalmanFilter
from baselines.estimation.motion_models import MotionModel
from baselines.estimation.run_filter import run_filter
from studies.radar.particles import ParticleFilter

DEVIATION, SPEED = 5.0, 20.0


def tracks(length=1.0):
    """Return measurements (T, B, d) and times (T,); tick 7 is missing."""
    generator = np.random.default_rng(3)
    times = np.cumsum(generator.uniform(0.5, 1.5, 25))
    truth = times[:, None, None] * generator.normal(0.0, SPEED, (1, 6, 2))
    measured = truth + generator.normal(0.0, DEVIATION, truth.shape)
    measured[7] = np.nan
    return length * measured, times


@pytest.mark.parametrize("length", [1.0, 1e-3, 1e4])
def test_particles_equal_the_kalman_filter_with_normal_errors(length):
    measured, times = tracks(length)
    model = MotionModel("CV", axes=2, noise=4.0 * length**2)
    P = 20_000
    kalman = KalmanFilter(model, (DEVIATION * length) ** 2, (SPEED * length,))
    particles = ParticleFilter(model, DEVIATION * length, (SPEED * length,), particles=P)
    expected, found = (
        run_filter(one, measured, times, horizons=(2.0,)) for one in (kalman, particles)
    )
    for mine, other in (
        (found, expected),
        (found.forecasts[0], expected.forecasts[0]),
    ):
        deviation = np.sqrt(np.diagonal(other.covariances, axis1=-2, axis2=-1))
        assert np.abs((mine.states - other.states) / deviation)[1:].max() < 20.0 / np.sqrt(P)
        ratio = np.diagonal(mine.covariances, axis1=-2, axis2=-1) / deviation**2
        assert np.abs(ratio - 1.0).max() < 0.2

    assert np.abs(found.log_likelihoods - expected.log_likelihoods)[1:].max() < 0.15


def test_forecasts_are_those_of_a_filter_that_only_predicts():
    measured, times = tracks()
    kalman = KalmanFilter(
        MotionModel("CV", axes=2, noise=4.0),
        DEVIATION**2,
        (SPEED,),
    )
    found = run_filter(kalman, measured[:, 0], times, horizons=(0.0, 3.0))

    np.testing.assert_allclose(found.forecasts[0].states, found.states)
    np.testing.assert_allclose(
        found.forecasts[1].positions,
        found.positions + 3.0 * found.velocities,
    )
    assert (found.forecasts[1].covariances[3, 0, 0] > found.covariances[3, 0, 0]).all()


def test_a_wide_kernel_gives_the_kalman_filter_and_a_narrow_one_ignores_outliers():
    innovation = np.array([0.5, -3.0, 80.0])
    predicted = np.array([1.0, 4.0, 2.0])
    variance = np.full(3, 2.0)
    wide = Correntropy(1e5).factors(innovation, predicted, variance)
    for mine, other in zip(wide, gaussian_factors(innovation, predicted, variance), strict=True):
        np.testing.assert_allclose(mine, other, rtol=1e-6)
    narrow = Correntropy(2.0).factors(innovation, predicted, variance)

    assert abs(narrow.state[2] * innovation[2] * predicted[2]) < 1e-3
    assert narrow.covariance[2] < 1e-6
