"""The bank equals the joint normal law of all measurements; its filters in matrix form:
`core/test_banks`.
"""

import numpy as np
import pytest
from scipy import stats

from hybrid_env import KalmanBank


def test_log_likelihood_equals_that_of_the_joint_normal_distribution_of_all_measurements():
    # No recursion: z_1 .. z_n of a straight track are jointly normal.
    tau = 0.1
    Q = 0.01
    R = 0.2
    n = 12
    start = np.array([0.3, 1.0, -0.2, 0.4])
    ticks = np.arange(n)
    # Weights of the first position and velocity, of covariance I, in the measured positions, and
    # of the velocity noise of each tick.
    of_start = np.stack([np.ones(n), tau * (ticks + 1)], axis=1)
    of_noise = tau * np.tril(np.subtract.outer(ticks, ticks))
    joint = of_start @ of_start.T + Q * of_noise @ of_noise.T + R * np.eye(n)
    z = np.random.default_rng(3).normal(0, 1, (n, 2))
    bank = KalmanBank([5.0], tau, Q, R)
    bank.anchor(start)
    for measurement in z:
        log_likelihood = bank.step(measurement)
    expected = sum(
        stats.multivariate_normal(of_start @ start[2 * axis : 2 * axis + 2], joint).logpdf(
            z[:, axis]
        )
        for axis in (0, 1)
    )

    assert log_likelihood[0] == pytest.approx(expected, rel=1e-12)
