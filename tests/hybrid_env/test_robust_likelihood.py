"""The robust likelihood has the density of Student's t, and makes an outlier harmless."""

import numpy as np
import pytest
from scipy import stats

from hybrid_env import HybridTrackVectorEnv
from hybrid_env.core.banks.kalman import student_log_likelihood, student_weight


def test_the_log_likelihood_is_that_of_the_bivariate_student_t_distribution():
    generator = np.random.default_rng(1)
    for _ in range(50):
        variances = generator.uniform(0.1, 9.0, 2)
        z = generator.normal(0, 5, 2)
        freedom = generator.uniform(1.0, 30.0)
        white = z / np.sqrt(variances)
        value = student_log_likelihood(
            *white,
            np.log(variances).mean(),
            freedom,
        )
        expected = stats.multivariate_t(shape=np.diag(variances), df=freedom).logpdf(z)
        assert value == pytest.approx(expected, abs=1e-12)
        weight = (freedom + 2) / (freedom + white @ white)
        assert student_weight(*white, freedom) == pytest.approx(min(weight, 1.0))


def test_an_outlier_moves_the_robust_estimate_less():
    errors = []
    for likelihood in ("gaussian", "student_t 4"):
        env = HybridTrackVectorEnv(
            2000,
            tick_info=True,
            scheme="S40",
            noise="levy 1.5 1 44",
            likelihood=likelihood,
        )
        env.reset(seed=1)
        for _ in range(39):
            info = env.step(np.zeros(2000, np.int64))[4]
        errors.append(np.median(((info["estimate"] - info["truth"])[:, [0, 2]] ** 2).sum(1)))

    assert errors[1] < 0.85 * errors[0]
