"""Seeding many tracks at once gives the streams of Gymnasium's generators."""

import numpy as np
import pytest
from gymnasium.utils import seeding

from hybrid_env import HybridTrackEnv, HybridTrackVectorEnv
from hybrid_env.world import random_states, state_of

SEEDS = [
    *range(300),
    2**31,
    2**32 - 1,
    2**32,
    2**32 + 7,
    2**63,
    2**64 - 1,
    2**64,
    2**100,
    12345678901234567,
]


def test_states_equal_those_of_the_generators():
    expected = [state_of(seeding.np_random(seed)[0]) for seed in SEEDS]
    np.testing.assert_array_equal(random_states(SEEDS), expected)


def test_none_draws_different_states():
    states = random_states([None, 5, None])
    assert len(np.unique(states)) == 12
    np.testing.assert_array_equal(states[1], random_states([5])[0])
    assert (random_states([None]) != random_states([None])).any()


@pytest.mark.parametrize(
    "first",
    [0, 2**32 - 2, 2**64 - 3],
)
def test_a_track_equals_a_single_environment(first):
    vector = HybridTrackVectorEnv(5)
    rows, _ = vector.reset(seed=first)
    for i, row in enumerate(rows):
        np.testing.assert_array_equal(
            HybridTrackEnv().reset(seed=first + i)[0],
            row,
        )
    for seeds in ([first + i for i in range(5)], np.array([first + i for i in range(5)])):
        np.testing.assert_array_equal(vector.reset(seed=seeds)[0], rows)
