"""The exact posteriors beside literal sums, and hindsight beside them."""

import itertools

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from baselines import smooth_modes
from hybrid_env import QuickestOptions, simulate
from studies.optimum.enumeration import path_posteriors

PATHS = {
    "ticks": 12,
    "tau": 0.5,
    "durations": "geometric 6",
    "start": "random",
    "process_variance": 0.0,
    "initial_error": 0.0,
    "heading": 0.0,
    "measurement_variance": 0.1,
}


def path_of(modes, tau):
    """Return the positions of an object without process noise, (T, 2)."""
    runs = [(mode, len(list(run))) for mode, run in itertools.groupby(modes)]
    scheme = " ".join(f"{'SLR'[mode]}{ticks}{'r5' if mode else ''}" for mode, ticks in runs)
    start = (0.0, 2.0, 0.0, 0.0)
    return simulate(scheme, start=start, tau=tau, process_variance=0.0).truth[0][:, [0, 2]]


def test_the_posterior_is_the_literal_sum_over_all_sequences_of_modes():
    options = QuickestOptions(**PATHS | {"ticks": 4})
    points = path_of((0, 1, 2, 2), options.tau)
    points += np.random.default_rng(1).normal(0.0, 0.3, (4, 2))
    chain = np.array([[10.0, 1.0, 1.0], [1.0, 10.0, 1.0], [1.0, 1.0, 10.0]]) / 12.0
    expected = np.zeros((4, 3))
    for ticks in range(1, 5):
        for modes in itertools.product(range(3), repeat=ticks):
            switches = [chain[pair] for pair in itertools.pairwise(modes)]
            density = multivariate_normal(path_of(modes, options.tau).ravel(), 0.1)
            weight = np.prod(switches) * density.pdf(points[:ticks].ravel())
            expected[ticks - 1, modes[-1]] += weight
    expected /= expected.sum(1, keepdims=True)

    assert 0.4 < expected.max(1).min() < 0.9
    posterior = np.exp(path_posteriors(options, points[None])[0])
    np.testing.assert_allclose(posterior, expected, atol=1e-12)


@pytest.mark.parametrize(("durations", "deviation"), [("geometric 50", 0.1), ("geometric 6", 0.3)])
def test_hindsight_is_within_a_thousandth_of_the_posterior_over_all_histories(durations, deviation):
    """In short recordings histories merge only if their last four segments are the same."""
    known = {"durations": durations, "measurement_variance": deviation**2}
    options = QuickestOptions(**PATHS | known)
    modes = [0] * 4 + [1] * 5 + [0] * (options.ticks - 9)
    path = path_of(modes, options.tau)
    start = np.array([0.0, 2.0, 0.0, 0.0]), np.zeros((4, 4))
    differences = []
    for seed in range(2):
        points = path + np.random.default_rng(seed).normal(0.0, deviation, path.shape)
        causal, expected = (
            np.exp(path_posteriors(options, points[None], smoothed)[0])
            for smoothed in (False, True)
        )
        result = smooth_modes(points, options, start)
        differences.append(np.abs(result.probabilities - expected).max())
        assert np.abs(causal - expected).max() > 0.2
    assert max(differences) < 0.001
