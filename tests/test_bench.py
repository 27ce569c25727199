"""The benchmark computes the same as its peer. No time is asserted."""

import numpy as np

from hybrid_env import KalmanBank
from tools.bench.filters import START, FilterpyBank


def test_the_bank_and_its_peer_compute_the_same_likelihoods():
    radii = (3.0, 5.0, 9.0)
    ours, theirs = KalmanBank(radii), FilterpyBank(radii)
    ours.anchor(START)
    generator = np.random.default_rng(5)
    for k in range(30):
        z = np.array([0.0, 0.2 * (k + 1)]) + generator.normal(0, 0.3, 2)
        ours.step(z)
        theirs.step(z)

    np.testing.assert_allclose(ours.log_likelihood, theirs.log_likelihood, rtol=1e-10)
