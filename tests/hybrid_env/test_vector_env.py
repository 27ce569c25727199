"""The vector environment agrees with single environments in each autoreset mode."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from own_modes import every_mode
from own_noise import Rounded

from hybrid_env import HybridTrackQuickestVectorEnv, HybridTrackVectorEnv, Sensor
from hybrid_env.core.memory import LANES

SHORT = {"ticks": 40, "durations": "uniform 5-12"}
BRIEF = {"scheme": "random 2x5-30"}
SENSORS = (Sensor(variance=0.4, period=2), Sensor(variance=0.05, position=(3.0, 4.0), range=4.0))
CLIMBS = "straight, left 5, stop, climb 1, descend 0.5"
NEXT, SAME = AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP
MADE = [
    ("HybridTrackPublished-v0", NEXT, BRIEF | {"noise": "levy 1.5 1 44", "bank_info": True}),
    ("HybridTrackPublished-v0", SAME, BRIEF | {"sensors": SENSORS, "missed": 0.4}),
    ("HybridTrack-v0", SAME, BRIEF | {"decide_every": 1, "drift_variance": 0.02, "missed": 0.2}),
    ("HybridTrackBank-v0", NEXT, BRIEF | {"decide_every": 5, "missed": 0.3}),
    ("HybridTrackRaw-v0", SAME, BRIEF | {"decide_every": 4, "missed": 0.2}),
    ("HybridTrack-v0", NEXT, BRIEF | {"decide_every": 4, "evidence": 0.9}),
    ("HybridTrack-v0", NEXT, BRIEF | {"decide_every": 4, "observation": "state"}),
    ("HybridTrackQuickest-v0", SAME, SHORT | {"sensors": SENSORS, "noise": "student_t 3"}),
    (
        "HybridTrack-v0",
        SAME,
        BRIEF
        | {
            "decide_every": 3,
            "sensors": ["radar 0.3 0.01 rate 0.1 at 9 0", "0.4"],
            "noise": Rounded(0.25),
        },
    ),
    ("HybridTrackQuickest-v0", NEXT, SHORT | {"noise": Rounded(), "missed": 0.2}),
    (
        "HybridTrackQuickest-v0",
        NEXT,
        {"ticks": 40, "durations": "drawn", "transitions": "drawn", "start": "random"},
    ),
    (
        "HybridTrack-v0",
        NEXT,
        BRIEF | {"decide_every": 1, "modes": every_mode(), "missed": 0.3, "bank_info": True},
    ),
    ("HybridTrackQuickest-v0", SAME, SHORT | {"modes": every_mode(), "sensors": SENSORS}),
    (
        "HybridTrack-v0",
        NEXT,
        BRIEF | {"decide_every": 3, "modes": CLIMBS, "missed": 0.3, "bank_info": True},
    ),
    ("HybridTrack-v0", SAME, BRIEF | {"decide_every": 1, "modes": CLIMBS, "follow": "bank"}),
    ("HybridTrackQuickest-v0", NEXT, SHORT | {"modes": CLIMBS, "noise": "outliers 0.1"}),
    *(
        (env_id, mode, {"max_episode_steps": 7} | options)
        for mode in (NEXT, SAME)
        for env_id, options in (
            ("HybridTrack-v0", BRIEF | {"decide_every": 1}),
            ("HybridTrackQuickest-v0", SHORT),
        )
    ),
]
VIEWS = {
    "announced": (
        HybridTrackVectorEnv,
        {
            "scheme": "random 2x5-9",
            "radii": (3.0, 5.0),
            "bank": "anchor_aware",
            "evidence": 0.5,
            "noise": Rounded(0.25),
        },
    ),
    "unknown": (HybridTrackQuickestVectorEnv, SHORT),
}
"""The environment with each kind of switches, and options of short episodes."""


def random_actions(generator, shape, count):
    """Draw mostly waiting actions, so that episodes are long and decision times vary."""
    return np.where(generator.random(shape) < 0.93, 0, generator.integers(0, count, shape))


@pytest.mark.parametrize(("env_id", "mode", "options"), MADE)
def test_tracks_equal_single_environments_bit_for_bit_across_autoresets(env_id, mode, options):
    tracks = LANES + 1
    ours = gym.make_vec(env_id, tracks, autoreset_mode=mode, tick_info=True, **options)
    theirs = SyncVectorEnv([lambda: gym.make(env_id, **options)] * tracks, autoreset_mode=mode)
    # Those of the last tracks have more than 64 bits.
    first, expected = ours.reset(seed=2**64 - 3), theirs.reset(seed=2**64 - 3)
    np.testing.assert_array_equal(first[0], expected[0])
    compare_infos(first[1], expected[1])
    generator = np.random.default_rng(0)
    episodes = 0
    for _ in range(120):
        actions = random_actions(generator, tracks, ours.single_action_space.n)
        mine, other = ours.step(actions), theirs.step(actions)
        np.testing.assert_equal(mine[:4], other[:4])
        compare_infos(mine[4], other[4])
        episodes += (mine[2] | mine[3]).sum()

    assert episodes > 0


def compare_infos(mine, other):
    """Compare the info of two vector environments, of which the first has the same keys in every
    step.
    """
    assert set(mine) >= set(other)
    assert not any(mine[key].any() for key in set(mine) - set(other) if key.startswith("_"))
    for key, value in other.items():
        if key == "final_info":
            compare_infos(mine[key], value)
        elif key == "final_obs":
            np.testing.assert_equal(list(mine[key]), list(value))
        else:
            mask = other["_" + key] if not key.startswith("_") else slice(None)
            np.testing.assert_array_equal(
                np.asarray(mine[key])[mask], np.asarray(value)[mask], err_msg=key
            )


def test_disabled_autoreset_resets_only_the_masked_tracks():
    env = HybridTrackVectorEnv(3, autoreset_mode="Disabled", tick_info=True, scheme="S4 S4")
    env.reset(seed=0)
    for _ in range(8):
        env.step(np.zeros(3, int))
    with pytest.raises(gym.error.ResetNeeded, match="reset_mask"):
        env.step(np.zeros(3, int))
    mask = np.array([True, False, True])
    _, info = env.reset(options={"reset_mask": mask})
    np.testing.assert_array_equal(info["_tick"], mask)
    assert info["tick"].tolist() == [1, 0, 1]


@pytest.mark.parametrize("view", VIEWS)
def test_results_do_not_depend_on_threads(view):
    tracks = 61
    make, options = VIEWS[view]
    generator = np.random.default_rng(4)
    alone, threaded = (
        make(tracks, threads=threads, tick_info=True, **options) for threads in (1, 3)
    )
    np.testing.assert_equal(alone.reset(seed=1), threaded.reset(seed=1))
    for _ in range(60):
        actions = random_actions(generator, tracks, alone.single_action_space.n)
        np.testing.assert_equal(alone.step(actions), threaded.step(actions))
    threaded.close()


def test_an_invalid_action_in_one_thread_steps_no_track():
    env, same = (HybridTrackVectorEnv(40, threads=2) for _ in range(2))
    rows = env.reset(seed=0)[0]
    same.reset(seed=0)
    actions = np.zeros(40, np.int64)
    actions[33] = 9
    with pytest.raises(gym.error.InvalidAction, match="action=9"):
        env.step(actions)
    with pytest.raises(gym.error.InvalidAction, match="expected integers of shape"):
        env.step([[0], 0])

    np.testing.assert_array_equal(env.world.observations, rows)
    np.testing.assert_array_equal(env.step(actions * 0)[0], same.step(actions * 0)[0])
