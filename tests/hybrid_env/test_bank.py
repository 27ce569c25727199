"""A bank of one's own equals the joint normal law of all measurements, and the bank of the
environment; its filters in matrix form: `core/test_banks`.
"""

import numpy as np
import pytest
from scipy import stats

from hybrid_env import HybridTrackVectorEnv, KalmanBank


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


@pytest.mark.parametrize("modes", [{"radii": (2.0, 9.0)}, {"modes": "left 2, stop, accelerate 1"}])
def test_a_bank_equals_that_of_the_environment(modes):
    R = 0.1, 0.5
    env = HybridTrackVectorEnv(
        1, tick_info=True, bank_info=True, measurement_variance=R, scheme="random 1x40", **modes
    )
    _, info = env.reset(seed=8)
    bank = KalmanBank(measurement_variance=R, **modes)
    bank.anchor(info["anchor"][0])
    for _ in range(30):
        np.testing.assert_allclose(bank.step(info["measurement"][0]), info["log_likelihood"][0])
        for name in ("innovations", "innovation_covariances", "estimates", "covariances"):
            np.testing.assert_allclose(getattr(bank, name), info[name][0], rtol=1e-9, atol=1e-12)
        *_, info = env.step(np.zeros(1, np.int64))
