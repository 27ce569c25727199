"""The worlds on a live sensor: their arrays are those of the environments, and damaged ones are refused."""

import copy

import numpy as np
import pytest

from hybrid_env import ArgumentError, QuickestOptions, WorldOptions
from hybrid_env.live import OnlineQuickestWorld, OnlineWorld
from hybrid_env.world import World

WORLDS = {OnlineWorld: WorldOptions(), OnlineQuickestWorld: QuickestOptions()}


@pytest.mark.parametrize("kind", WORLDS)
def test_arrays_and_spaces_are_those_of_the_environment(kind):
    options = WORLDS[kind]
    online, world = kind(options), World(options, 1)
    assert {name: (array.dtype, array.shape) for name, array in online.arrays().items()} == {
        name: (array.dtype, array.shape) for name, array in world.arrays().items()
    }
    assert online.action_space() == world.action_space()


@pytest.mark.parametrize(
    ("kind", "field"), [(OnlineWorld, "active_mode"), (OnlineQuickestWorld, "stated_mode")]
)
@pytest.mark.parametrize("value", [-1, 3, 2**62])
def test_a_state_with_a_mode_out_of_range_is_refused(kind, field, value):
    world = kind(WORLDS[kind])
    arrays = dict(world.arrays())
    arrays["blocks"] = arrays["blocks"].copy()
    arrays["blocks"][field][0, 0] = value
    with pytest.raises(ArgumentError, match=f"blocks.{field}="):
        world.restore(arrays)


@pytest.mark.parametrize("kind", WORLDS)
def test_more_segments_and_ticks_than_an_episode_has_are_allowed(kind):
    world = kind(WORLDS[kind])
    world.begin_track(np.array([0.0, 2.0, 0.0, 0.0]), np.eye(4), -1)
    world.begin_segment(5)
    for k in range(2000):
        if k % 100 == 0:
            world.begin_segment(5)
        world.measure(0.2 * (k + 1), 0.0)
        world.decide(0)
    other = copy.deepcopy(world)
    world.measure(400.2, 0.0)
    other.measure(400.2, 0.0)
    assert other.observations.tobytes() == world.observations.tobytes()
    assert np.isfinite(world.observations).all()
