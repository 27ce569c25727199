"""The robust correction against direct integration, and in the world that it assumes."""

import numpy as np
from kinematic_worlds import mean_bounds, simulate, squared_errors
from scipy import integrate, stats

from studies.filters.correction import StudentT
from studies.filters.kalman import KalmanFilter
from studies.filters.motion_models import MotionModel
from studies.filters.run_filter import run_filter


def single(value):
    return np.array([value], np.float64)


def test_student_t_equals_numerical_integration_of_the_posterior():
    nu = 2.0
    rng = np.random.default_rng(0)
    for _ in range(6):
        m, r = 10.0 ** rng.uniform(-2, 2, 2)
        y = np.sqrt(m + r) * rng.normal() * 10.0 ** rng.uniform(-0.5, 0.8)

        def density(u, y=y, m=m, r=r):
            return (
                stats.norm.pdf(u, scale=np.sqrt(m))
                * stats.t.pdf((y - u) / np.sqrt(r), nu)
                / np.sqrt(r)
            )

        # At least a hundred nodes in the standard deviation of the measurement.
        nodes = np.sqrt(m) * np.linspace(-12.0, 12.0, 400_001)
        values = density(nodes)
        total = integrate.trapezoid(values, nodes)
        mean = integrate.trapezoid(nodes * values, nodes) / total
        variance = integrate.trapezoid((nodes - mean) ** 2 * values, nodes) / total
        a, b, log_likelihood = StudentT(nu).factors(single(y), single(m), single(r))
        np.testing.assert_allclose(log_likelihood, np.log(total), atol=1e-5)
        np.testing.assert_allclose(m * y * a, mean, rtol=1e-5, atol=1e-5 * np.sqrt(m))
        np.testing.assert_allclose(m - m * m * b, variance, rtol=1e-4)


def test_errors_are_as_large_as_the_filter_says_in_its_noise():
    rng = np.random.default_rng(5)
    model = MotionModel("CV", 2, 1.0)
    tracks = 1500
    times = np.arange(1.0, 26.0)
    start = np.kron(np.eye(2), np.diag([4.0, 25.0]))
    states, _ = simulate(rng, model, times, start, np.eye(2), tracks)
    kalman = KalmanFilter(model, 4.0, robust=StudentT(2.0))
    kalman.begin_from(np.zeros((tracks, 4)), start)
    measurements = states[..., ::2] + 2.0 * rng.standard_t(2.0, (25, tracks, 2))
    filtered = run_filter(kalman, measurements, times, begun=0.0)
    nees = squared_errors(states[-1] - filtered.states[-1], filtered.covariances[-1])
    low, high = mean_bounds(4.0, nees.var(), nees.size)

    assert low < nees.mean() < high
