"""The robust likelihood has the density of Student's t, and makes an outlier harmless."""

import numpy as np
import pytest
from scipy import stats

from hybrid_env.core.banks.kalman import student_log_likelihood, student_weight


def test_the_log_likelihood_is_that_of_the_bivariate_student_t_distribution():
    generator = np.random.default_rng(1)
    for _ in range(50):
        variances = generator.uniform(0.1, 9.0, 2)
        z = generator.normal(0, 5, 2)
        freedom = generator.uniform(1.0, 30.0)
        white = z / np.sqrt(variances)
        value = student_log_likelihood(*white, np.log(variances).mean(), freedom)
        expected = stats.multivariate_t(shape=np.diag(variances), df=freedom).logpdf(z)
        assert value == pytest.approx(expected, abs=1e-12)
        weight = (freedom + 2) / (freedom + white @ white)
        assert student_weight(*white, freedom) == pytest.approx(min(weight, 1.0))
