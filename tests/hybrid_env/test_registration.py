"""The registered ids with the checkers and subprocesses of other libraries."""

import functools
import re

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env as gymnasium_check
from gymnasium.vector import AsyncVectorEnv

import hybrid_env
from hybrid_env import ArgumentError, HybridTrackEnv, Sensor

SENSORS = (
    Sensor(variance=0.4, period=2),
    Sensor(variance=0.05, position=(3.0, 4.0), range=4.0),
    Sensor(variance=1.0),
)
CHECKED = [
    *((env_id, {}) for env_id in hybrid_env.ENVIRONMENTS),
    ("HybridTrackPublished-v0", {"missed": 0.1, "sensors": SENSORS}),
    ("HybridTrack-v0", {"missed": 0.9, "bank_info": True}),
    ("HybridTrackQuickest-v0", {"missed": 0.9}),
    ("HybridTrack-v0", {"modes": "straight, left 5, climb 0.5"}),
    ("HybridTrackQuickest-v0", {"modes": "straight, left 5, climb 0.5"}),
]


@pytest.mark.parametrize(("env_id", "options"), CHECKED)
def test_the_checkers_of_gymnasium_and_stable_baselines3_pass(env_id, options):
    pytest.importorskip("matplotlib")
    sb3 = pytest.importorskip("stable_baselines3.common.env_checker")
    env = gym.make(env_id, render_mode="rgb_array", **options).unwrapped
    gymnasium_check(env, skip_render_check=bool(options))
    sb3.check_env(env, skip_render_check=bool(options))


def test_processes_create_the_environment_by_module_and_id():
    make = functools.partial(gym.make, "hybrid_env:HybridTrackPublished-v0")
    env = AsyncVectorEnv([make, make])
    try:
        rows = env.reset(seed=6)[0]
        np.testing.assert_array_equal(rows[1], gym.make("HybridTrackPublished-v0").reset(seed=7)[0])
        assert env.step(np.array([0, 1]))[0].shape == (2, 29)
    finally:
        env.close()


def test_the_keys_declare_straight_left_and_right():
    for key, expected in (("w", {0}), ("a", {1, 2}), ("d", {3, 4})):
        env = HybridTrackEnv(radii=(3.0, 5.0), actions="types", correctness="type")
        env.reset(seed=0)
        *_, info = env.step(env.get_keys_to_action()[(ord(key),)])
        assert info["decided_mode"] in expected


@pytest.mark.parametrize("make", [gym.make, gym.make_vec])
def test_an_option_that_does_not_exist_is_refused_as_by_python_with_the_nearest_one(make):
    words = "got an unexpected keyword argument '{}'"
    near = ": did you mean 'measurement_variance'"
    with pytest.raises(TypeError, match=re.escape(words.format("mesurement_variance") + near)):
        make("hybrid_env:HybridTrack-v0", mesurement_variance=1.0)
    # Libraries try keywords, and read these words.
    with pytest.raises(ArgumentError, match=words.format("frameskip")):
        make("hybrid_env:HybridTrack-v0", frameskip=1)
