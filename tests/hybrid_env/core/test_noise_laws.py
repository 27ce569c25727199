"""Draws of every law have the distribution of SciPy, and that of the page its own.

That they do not depend on other tracks is tested with the environments: `test_vector_env`.
"""

import numpy as np
import pytest
from drawn_noise import drawn_noise
from own_noise import run_page
from scipy import stats


def errors(law, count, seed=3):
    """Return the errors of `count` measurements over sqrt(R), (2, count), and the noise of the
    velocities.
    """
    drawn = drawn_noise(20, count // 20, seed, noise=law).swapaxes(0, 1).reshape(4, -1)
    return drawn[2:], drawn[:2]


DISTRIBUTIONS = [
    ("that of the page", stats.laplace(scale=0.7), 100_000),
    ("gaussian", stats.norm(), 100_000),
    ("levy 1", stats.cauchy(), 100_000),
    ("levy 1.5 2", stats.levy_stable(1.5, 0.0, scale=2.0), 1600),
    ("levy 0.6", stats.levy_stable(0.6, 0.0), 800),
    ("levy 1.9", stats.levy_stable(1.9, 0.0), 800),
    ("student_t 3", stats.t(3), 100_000),
]


@pytest.mark.parametrize(
    ("law", "distribution", "count"), DISTRIBUTIONS, ids=[case[0] for case in DISTRIBUTIONS]
)
def test_errors_have_the_distribution_of_their_law(law, distribution, count):
    if law == "that of the page":
        law = run_page()["env"].unwrapped.options.noise
    drawn, velocities = errors(law, count // 2)
    assert stats.kstest(drawn.ravel(), distribution.cdf).pvalue > 1e-3
    assert stats.kstest(velocities.ravel(), "norm").pvalue > 1e-3


def test_the_coordinates_of_a_student_t_error_have_the_bivariate_distribution():
    x, y = errors("student_t 4", 100_000, 5)[0]
    # (x^2 + y^2) / 2 has the F distribution, and the angle is uniform.
    assert stats.kstest((x * x + y * y) / 2, stats.f(2, 4).cdf).pvalue > 1e-3
    assert stats.kstest(np.arctan2(y, x) / (2 * np.pi) + 0.5, "uniform").pvalue > 1e-3


def test_errors_are_clipped():
    assert np.abs(errors("levy 0.5 1 3", 8000, 7)[0]).max() == pytest.approx(3.0)
    for law in ("levy 0.5", "student_t 1"):
        assert np.abs(errors(law, 100_000, 8)[0]).max() <= 1e6 * (1 + 1e-9)


def test_outliers_have_the_given_share_and_ratio():
    drawn = errors("outliers 0.2 10", 100_000, 9)[0]
    mixture = lambda x: 0.8 * stats.norm.cdf(x) + 0.2 * stats.norm.cdf(x / 10.0)  # noqa: E731

    assert stats.kstest(drawn.ravel(), mixture).pvalue > 1e-3
    # Both coordinates of a measurement are outliers together.
    together = (np.abs(drawn) > 9.0).all(0).mean()
    expected = 0.2 * (2.0 * stats.norm.sf(0.9)) ** 2
    assert together == pytest.approx(expected, abs=4.0 * np.sqrt(expected / (drawn.size / 2)))
