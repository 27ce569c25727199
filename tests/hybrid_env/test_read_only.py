"""Attributes and arrays that compiled code relies on cannot be replaced; copies do not share memory."""

import copy
import pickle

import numpy as np
import pytest

import hybrid_env
from hybrid_env import ArgumentError, HybridTrackVectorEnv, KalmanBank
from hybrid_env.core.records import LANES
from hybrid_env.worlds.world import World


@pytest.mark.parametrize("name", sorted(World.read_only))
def test_an_array_of_a_world_cannot_be_replaced(name):
    world = HybridTrackVectorEnv(2).world
    with pytest.raises(AttributeError, match=f"World.{name} is read-only"):
        setattr(world, name, getattr(world, name))


@pytest.mark.parametrize("name", ["options", "world"])
@pytest.mark.parametrize("make", [HybridTrackVectorEnv, hybrid_env.HybridTrackEnv])
def test_the_options_of_an_environment_cannot_be_replaced(make, name):
    env = make()
    with pytest.raises(AttributeError, match=f"{name} is read-only"):
        setattr(env, name, None)


@pytest.mark.parametrize("name", ["radii", "tau", "process_variance", "variances"])
def test_the_model_of_a_bank_cannot_be_replaced(name):
    bank = KalmanBank()
    with pytest.raises(AttributeError, match=f"KalmanBank.{name} is read-only"):
        setattr(bank, name, np.arange(1.0, 5001.0))
    bank.anchor([0.0, 2.0, 0.0, 0.0])
    with pytest.raises(ValueError, match="read-only"):
        bank.radii[0] = 1.0


def test_an_array_given_as_an_option_can_change_later():
    variance = np.array([0.1, 0.2])
    env = hybrid_env.HybridTrackEnv(measurement_variance=variance, radii=np.array([3.0, 5.0]))
    env.reset(seed=0)
    variance.resize(1, refcheck=False)
    variance[:] = np.nan
    copied = copy.deepcopy(env)
    np.testing.assert_array_equal(copied.step(0)[0], env.step(0)[0])


@pytest.mark.parametrize("tracks", [1, LANES, LANES + 3])
def test_a_copy_has_memory_of_its_own(tracks):
    env = HybridTrackVectorEnv(tracks, trace_rows=3)
    env.reset(seed=0)
    for other in (copy.deepcopy(env), copy.copy(env.world), pickle.loads(pickle.dumps(env))):
        world = other if isinstance(other, World) else other.world
        for name, array in world.arrays().items():
            np.testing.assert_array_equal(array, env.world.arrays()[name])
            assert not np.shares_memory(array, env.world.arrays()[name])
        assert world.blocks.ctypes.data % 64 == 0


def _missing(arrays):
    del arrays["rewards"]


def _wider(arrays):
    arrays["observations"] = np.zeros((8, 29), np.float32)


def _fewer(arrays):
    arrays["bank.hypotheses"] = arrays["bank.hypotheses"][:, :-1]


def _text(arrays):
    arrays["trace"] = "text"


def _out_of_range(arrays, name, value):
    arrays["blocks"] = arrays["blocks"].copy()
    arrays["blocks"][name][0, 0] = value


@pytest.mark.parametrize("damage", [_missing, _wider, _fewer, _text])
def test_a_state_of_other_arrays_is_refused(damage):
    world = HybridTrackVectorEnv(8).world
    arrays = dict(world.arrays())
    damage(arrays)
    with pytest.raises(ArgumentError, match="the state of the tracks has no array"):
        world.restore(arrays)


@pytest.mark.parametrize("value", [-1, 7, 2**62])
@pytest.mark.parametrize("name", ["segment", "true_mode", "active_mode", "trace_length"])
def test_a_state_with_an_index_out_of_range_is_refused(name, value):
    world = HybridTrackVectorEnv(8).world
    arrays = dict(world.arrays())
    _out_of_range(arrays, name, value)
    with pytest.raises(ArgumentError, match=f"blocks.{name}="):
        world.restore(arrays)
