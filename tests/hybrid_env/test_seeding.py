"""Seeding many tracks at once gives the streams of Gymnasium's generators."""

import numpy as np
import pytest
from gymnasium.utils import seeding

from hybrid_env import ArgumentError, HybridTrackEnv, HybridTrackVectorEnv
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


BAD_SEEDS = [
    np.array(3),
    -1,
    True,
    1.5,
    "12345",
    [1, 2],
    (1, 2),
    [1, 2, 3, 4, -5],
    [1, 2, 3, 4, 0.5],
    {},
    np.zeros((5, 5)),
    object(),
]


@pytest.mark.parametrize("seed", BAD_SEEDS, ids=range(len(BAD_SEEDS)))
def test_a_seed_that_is_not_allowed_is_named(seed):
    for env in (HybridTrackVectorEnv(5), HybridTrackEnv()):
        with pytest.raises(ArgumentError, match=r"^seed="):
            env.reset(seed=seed)


@pytest.mark.parametrize("options", [5, "mask", [True]])
def test_options_of_reset_are_a_dict(options):
    for env in (HybridTrackVectorEnv(2), HybridTrackEnv()):
        with pytest.raises(ArgumentError, match=r"^options="):
            env.reset(options=options)


SIZES = [
    {"num_envs": 0},
    {"num_envs": 2.0},
    {"num_envs": 10**30},
    {"num_envs": np.array(3)},
    {"num_envs": 2**31 - 1, "trace_rows": 10**6},
    {"trace_rows": -1},
    {"trace_rows": 10**12},
    {"threads": 0},
    {"threads": 10**9},
    {"autoreset_mode": "soon"},
]


@pytest.mark.parametrize("arguments", SIZES, ids=str)
def test_an_argument_of_the_vector_environment_that_is_not_allowed_is_named(arguments):
    with pytest.raises(ArgumentError, match=f"^{next(iter(arguments))}=") as caught:
        HybridTrackVectorEnv(**arguments)
    assert len(str(caught.value)) <= 300
