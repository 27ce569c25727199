"""Random numbers are normal, and those of neighbouring seeds and lanes are independent.

Bounds are 5 standard errors of the sample size.
"""

import itertools
import math

import numpy as np
import pytest
from drawn_noise import drawn_noise
from scipy import special, stats

from hybrid_env.core.memory import LANES

FIVE_SIGMA = 2.0 * stats.norm.sf(5.0)


@pytest.mark.parametrize(
    "count",
    [pytest.param(3 * 10**5, id="quick"), pytest.param(10**8, id="study", marks=pytest.mark.study)],
)
def test_draws_are_standard_normal_in_histogram_and_tails(count):
    bins = 1000
    histogram = np.zeros(bins)
    beyond = np.zeros(3)
    total = 0
    for seed in itertools.count(5, 1024):
        sample = drawn_noise(min(count // 4096 + 1, 1000), 1024, seed).ravel()
        histogram += np.bincount((special.ndtr(sample) * bins).astype(int), minlength=bins)
        beyond += [(np.abs(sample) > limit).sum() for limit in (3.0, 4.0, 5.0)]
        total += sample.size
        if total >= count:
            break
    assert stats.chisquare(histogram).pvalue > FIVE_SIGMA
    for limit, far in zip((3.0, 4.0, 5.0), beyond, strict=True):
        tail = 2 * stats.norm.sf(limit)
        assert stats.binomtest(int(far), total, tail).pvalue > FIVE_SIGMA


@pytest.mark.parametrize(
    ("seeds", "ticks"),
    [
        pytest.param(64, 2000, id="quick"),
        pytest.param(1024, 25_000, id="study", marks=pytest.mark.study),
    ],
)
def test_streams_of_neighbouring_seeds_and_lanes_are_uncorrelated(seeds, ticks):
    # Lane i of the environment has seed 1000 + i.
    streams = drawn_noise(ticks, seeds, 1000)
    for transform in (lambda z: z, lambda z: (z**2 - 1.0) / math.sqrt(2.0), np.sign):
        values = transform(streams)
        for distance, lag in itertools.product((1, 2, LANES), (0, 1, -1)):
            ahead = values[max(lag, 0) : ticks + min(lag, 0), :, distance:]
            behind = values[max(-lag, 0) : ticks - max(lag, 0), :, : seeds - distance]
            # Products of every pair of neighbours.
            pairs = (ahead * behind).mean((0, 1))
            error = 1.0 / math.sqrt(4 * ahead.shape[0])
            assert np.abs(pairs).max() < 5.0 * error, (distance, lag)
            assert abs(pairs.mean()) < 5.0 * error / math.sqrt(pairs.size), (distance, lag)
        # Between the four draws of a tick.
        for i, j in itertools.combinations(range(4), 2):
            product = values[:, i] * values[:, j]
            assert abs(product.mean()) < 5.0 / math.sqrt(product.size), (i, j)
