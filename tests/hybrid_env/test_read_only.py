"""Attributes and arrays that compiled code relies on cannot be replaced; copies do not share
memory.
"""

import copy
import functools
import pickle

import numpy as np
import pytest

from hybrid_env import (
    ArgumentError,
    HybridTrackEnv,
    HybridTrackQuickestEnv,
    HybridTrackQuickestVectorEnv,
    HybridTrackVectorEnv,
    QuickestOptions,
    WorldOptions,
)
from hybrid_env.core.memory import LANES
from hybrid_env.world import World

ENVIRONMENTS = [
    HybridTrackVectorEnv,
    HybridTrackEnv,
    HybridTrackQuickestVectorEnv,
    HybridTrackQuickestEnv,
]


@pytest.mark.parametrize("make", ENVIRONMENTS)
def test_options_and_arrays_of_an_environment_cannot_be_replaced(make):
    env = make()
    for owner, names in (
        (env, ("options", "world")),
        (env.world, sorted(env.world.read_only)),
    ):
        for name in names:
            with pytest.raises(AttributeError, match=f"{type(owner).__name__}.{name} is read-only"):
                setattr(owner, name, None)


@pytest.mark.parametrize("tracks", [1, LANES + 3])
@pytest.mark.parametrize(
    ("make", "options"),
    [
        (HybridTrackVectorEnv, {"trace_rows": 3}),
        (HybridTrackQuickestVectorEnv, {}),
    ],
)
@pytest.mark.parametrize("threads", [1, 2])
def test_a_copy_has_memory_of_its_own_and_continues_alike(make, options, tracks, threads):
    env = make(tracks, threads=threads, **options)
    env.reset(seed=0)
    copies = [copy.deepcopy(env), copy.copy(env), pickle.loads(pickle.dumps(env))]
    for world in (*(other.world for other in copies), copy.copy(env.world)):
        for name, array in world.arrays().items():
            np.testing.assert_array_equal(array, env.world.arrays()[name])
            assert not np.shares_memory(array, env.world.arrays()[name])
        assert world.blocks.ctypes.data % 64 == 0
    for k in range(60):
        actions = np.full(tracks, k // 5 % 3)
        rows = env.step(actions)[0]
        for other in copies:
            np.testing.assert_array_equal(other.step(actions)[0], rows)


DAMAGED = {
    "missing": lambda arrays: arrays.pop("rewards"),
    "wider": lambda arrays: arrays.update(observations=np.zeros((8, 29), np.float32)),
    "fewer": lambda arrays: arrays.update({"bank.hypotheses": arrays["bank.hypotheses"][:, :-1]}),
    "text": lambda arrays: arrays.update(trace="text"),
}


@pytest.mark.parametrize("damage", DAMAGED.values(), ids=DAMAGED)
def test_a_state_of_other_arrays_is_refused(damage):
    world = HybridTrackVectorEnv(8).world
    arrays = dict(world.arrays())
    damage(arrays)
    with pytest.raises(ArgumentError, match="the state of the tracks has no array"):
        world.restore(arrays)


ANNOUNCED, UNKNOWN = WorldOptions(), QuickestOptions()
INDICES = [
    (World, ANNOUNCED, ("segment", "true_mode", "active_mode", "trace_length", "length")),
    (World, UNKNOWN, ("segment", "true_mode", "stated_mode", "time", "length")),
    (functools.partial(World, live=True), ANNOUNCED, ("active_mode",)),
    (functools.partial(World, live=True), UNKNOWN, ("stated_mode",)),
]


@pytest.mark.parametrize(("kind", "options", "names"), INDICES)
@pytest.mark.parametrize("value", [-1, 2**40, 2**62])
def test_a_state_with_an_index_out_of_range_is_refused(kind, options, names, value):
    world = kind(options, 1)
    for name in names:
        arrays = dict(world.arrays())
        arrays["blocks"] = arrays["blocks"].copy()
        arrays["blocks"][name][0, 0] = value
        with pytest.raises(ArgumentError, match=f"blocks.{name}="):
            world.restore(arrays)
