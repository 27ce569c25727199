"""Random numbers are normal, and those of neighbouring seeds and lanes are independent.

Bounds are 5 standard errors of the sample size.
"""

import itertools
import math

import numpy as np
import pytest
from drawn_noise import drawn_noise
from scipy import special, stats

from hybrid_env import HybridTrackVectorEnv
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


def test_the_first_draws_of_successive_seeds_are_independent():
    tracks = 20_000
    env = HybridTrackVectorEnv(tracks, tick_info=True, process_variance=0.0, initial_error=0)
    _, info = env.reset(seed=0)
    heading = np.arctan2(info["anchor"][:, 3], info["anchor"][:, 1])
    uniform = (heading / (2.0 * math.pi)) % 1.0
    noise = (info["measurement"] - info["truth"][:, [0, 2]]) / math.sqrt(0.1)
    counts = np.bincount(info["true_mode"], minlength=3)

    assert stats.kstest(uniform, "uniform").pvalue > FIVE_SIGMA
    assert stats.chisquare(counts).pvalue > FIVE_SIGMA
    centred = (uniform - 0.5) * math.sqrt(12.0)
    mode = (info["true_mode"] - 1.0) * math.sqrt(1.5)
    for first, second in itertools.product((centred, noise[:, 0], noise[:, 1], mode), repeat=2):
        assert abs((first[1:] * second[:-1]).mean()) < 5.0 / math.sqrt(tracks - 1)
