"""The robust correction against direct integration."""

import numpy as np
from scipy import integrate, stats

from studies.filters.correction import StudentT


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
