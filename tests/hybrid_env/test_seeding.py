"""Seeding many tracks at once gives the streams of Gymnasium's generators."""

import numpy as np
import pytest

from hybrid_env import HybridTrackEnv, HybridTrackVectorEnv
from hybrid_env.world import random_states


def test_none_draws_different_states():
    assert len(np.unique(random_states([None, 5, None]))) == 12


@pytest.mark.parametrize("first", [0, 2**64 - 3])
def test_a_track_equals_a_single_environment(first):
    vector = HybridTrackVectorEnv(5)
    rows, _ = vector.reset(seed=first)
    for i, row in enumerate(rows):
        np.testing.assert_array_equal(HybridTrackEnv().reset(seed=first + i)[0], row)
    seeds = [first + i for i in range(5)]
    np.testing.assert_array_equal(vector.reset(seed=seeds)[0], rows)
