"""Particles equal the Kalman filter where it is exact."""

import numpy as np
import pytest

from baselines import KalmanFilter, MotionModel, run_filter
from studies.radar.particles import ParticleFilter

DEVIATION = 5.0
SPEED = 20.0
PARTICLES = 20_000


@pytest.mark.parametrize("length", [1.0, 1e-3, 1e4])
def test_particles_equal_the_kalman_filter_with_normal_errors(length):
    generator = np.random.default_rng(3)
    times = np.cumsum(generator.uniform(0.5, 1.5, 25))
    velocities = generator.normal(0.0, SPEED, (1, 6, 2))
    truth = times[:, None, None] * velocities
    measured = length * (truth + generator.normal(0.0, DEVIATION, truth.shape))
    measured[7] = np.nan
    model = MotionModel(
        "CV",
        axes=2,
        noise=4.0 * length**2,
    )
    deviation = DEVIATION * length
    start = (SPEED * length,)
    kalman = KalmanFilter(model, deviation**2, start)
    particles = ParticleFilter(model, deviation, start, particles=PARTICLES)
    expected = run_filter(kalman, measured, times, horizons=(2.0,))
    found = run_filter(particles, measured, times, horizons=(2.0,))
    for mine, other in ((found, expected), (found.forecasts[0], expected.forecasts[0])):
        deviations = np.sqrt(np.diagonal(other.covariances, axis1=-2, axis2=-1))
        error = np.abs((mine.states - other.states) / deviations)
        assert error[1:].max() < 20.0 / np.sqrt(PARTICLES)
        ratio = np.diagonal(mine.covariances, axis1=-2, axis2=-1) / deviations**2
        assert np.abs(ratio - 1.0).max() < 0.2

    difference = found.log_likelihoods - expected.log_likelihoods
    assert np.abs(difference)[1:].max() < 0.15
