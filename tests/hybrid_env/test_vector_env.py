"""The vector environment agrees with single environments in each autoreset mode."""

import os
import pickle
import signal

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from hybrid_env import (
    HybridTrackEnv,
    HybridTrackQuickestEnv,
    HybridTrackQuickestVectorEnv,
    HybridTrackVectorEnv,
    Sensor,
)
from hybrid_env.core.memory import LANES

SHORT = {"ticks": 40, "durations": "uniform 5-12"}
UNEQUAL = {"radii": (3.0, 8.0), "measurement_variance": (0.05, 0.2)}
SENSORS = (
    Sensor(variance=0.4, period=2),
    Sensor(
        variance=0.05,
        position=(3.0, 4.0),
        range=4.0,
    ),
)
MADE = [
    ("HybridTrackPublished-v0", {}),
    ("HybridTrackPublishedBank-v0", {}),
    ("HybridTrack-v0", {}),
    ("HybridTrackBank-v0", {}),
    (
        "HybridTrack-v0",
        {
            "correctness": "type",
            "actions": "types",
            "missed": 0.3,
        },
    ),
    ("HybridTrackQuickest-v0", SHORT),
    ("HybridTrackQuickest-v0", SHORT | UNEQUAL),
    *(
        (env_id, short | options)
        for env_id, short in (
            ("HybridTrackPublished-v0", {}),
            ("HybridTrackQuickest-v0", SHORT),
        )
        for options in (
            {"missed": 0.4},
            {"sensors": SENSORS, "missed": 0.4},
        )
    ),
    ("HybridTrackPublished-v0", {"noise": "levy 1.5 1 44", "bank_info": True}),
    ("HybridTrackPublished-v0", {"bank": "anchor_aware", "noise": "outliers 0.1"}),
    ("HybridTrackPublished-v0", {"bank": "anchor_aware", "follow": "bank"}),
    (
        "HybridTrackQuickest-v0",
        {
            "ticks": 40,
            "durations": "drawn",
            "order": "drawn",
            "start": "random",
        },
    ),
    ("HybridTrackQuickest-v0", {"ticks": 40, "order": "cycle"}),
    ("HybridTrackQuickest-v0", SHORT | {"noise": "student_t 3"}),
]
VIEWS = {
    "announced": (
        HybridTrackVectorEnv,
        HybridTrackEnv,
        {"scheme": "random 2x5-9", "radii": (3.0, 5.0)},
    ),
    "evidence": (
        HybridTrackVectorEnv,
        HybridTrackEnv,
        {
            "scheme": "random 2x5-9",
            "radii": (3.0, 5.0),
            "bank": "anchor_aware",
            "evidence": 0.5,
        },
    ),
    "unknown": (HybridTrackQuickestVectorEnv, HybridTrackQuickestEnv, SHORT),
}
"""The vector and the single environment with each kind of switches, and options of short
episodes.
"""


def random_actions(generator, shape, count):
    """Draw mostly waiting actions, so that episodes are long and decision times vary."""
    return np.where(
        generator.random(shape) < 0.93,
        0,
        generator.integers(0, count, shape),
    )


@pytest.mark.parametrize(("env_id", "options"), MADE)
def test_vector_tracks_equal_single_environments_bit_for_bit_across_autoresets(env_id, options):
    tracks = LANES + 3
    steps = 700
    seed = 42
    vector = gym.make_vec(env_id, tracks, tick_info=True, **options)
    singles = [gym.make(env_id, **options).unwrapped for _ in range(tracks)]
    rows, vector_info = vector.reset(seed=seed)
    restart = []
    for i, single in enumerate(singles):
        row, info = single.reset(seed=seed + i)
        assert row.tobytes() == rows[i].tobytes()
        restart.append(False)
    generator = np.random.default_rng(0)
    episodes = waited = 0
    for _ in range(steps):
        actions = random_actions(
            generator,
            tracks,
            vector.single_action_space.n,
        )
        rows, rewards, terminated, truncated, vector_info = vector.step(actions)
        assert not truncated.any()
        for i, single in enumerate(singles):
            if restart[i]:
                row, info = single.reset()
                reward = 0.0
                done = False
                episodes += 1
            else:
                row, reward, done, _, info = single.step(actions[i])
            restart[i] = done
            assert row.tobytes() == rows[i].tobytes()
            assert (reward, done) == (rewards[i], terminated[i])
            for key, value in info.items():
                assert vector_info[f"_{key}"][i]
                assert (
                    np.asarray(value).tobytes()
                    == np.asarray(vector_info[key][i]).astype(np.asarray(value).dtype).tobytes()
                )
            present = {
                key for key in vector_info if not key.startswith("_") and vector_info[f"_{key}"][i]
            }
            assert present == set(info)
            waited += not info["action_mask"][-1]

    assert episodes >= 2 * tracks
    assert (waited > 0) == (env_id in ("HybridTrack-v0", "HybridTrackBank-v0"))


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
@pytest.mark.parametrize("view", VIEWS)
def test_the_vector_environment_equals_a_sync_vector_env_of_single_environments(view, mode):
    vector, single, options = VIEWS[view]
    ours = vector(3, autoreset_mode=mode, tick_info=True, **options)
    theirs = SyncVectorEnv([lambda: single(**options)] * 3, autoreset_mode=mode)
    first = ours.reset(seed=7)
    expected = theirs.reset(seed=7)

    np.testing.assert_array_equal(first[0], expected[0])
    generator = np.random.default_rng(1)
    resets = 0
    for _ in range(300):
        actions = random_actions(generator, 3, ours.single_action_space.n)
        mine = ours.step(actions)
        other = theirs.step(actions)
        for k in range(4):
            np.testing.assert_array_equal(mine[k], other[k])
        resets += mine[2].sum()
        compare_infos(mine[4], other[4])
    assert resets > 20


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
            for row, expected in zip(mine[key], value, strict=True):
                assert (row is None) == (expected is None)
                if row is not None:
                    np.testing.assert_array_equal(row, expected)
        else:
            mask = other["_" + key] if not key.startswith("_") else slice(None)
            np.testing.assert_array_equal(
                np.asarray(mine[key])[mask],
                np.asarray(value)[mask],
                err_msg=key,
            )


@pytest.mark.parametrize("view", VIEWS)
def test_without_tick_info_the_mask_and_the_decisions_are_left(view):
    vector, _, options = VIEWS[view]
    short, described = (
        vector(
            3,
            tick_info=tick_info,
            **options,
        )
        for tick_info in (False, True)
    )
    generator = np.random.default_rng(2)
    info, full = short.reset(seed=7)[1], described.reset(seed=7)[1]
    for _ in range(60):
        assert {"action_mask", "_action_mask"} <= info.keys() <= full.keys() - {"tick"}
        assert ("decided_mode" in info) == full.get("_decided_mode", np.zeros(3)).any()
        for name, values in info.items():
            np.testing.assert_array_equal(values, full[name], err_msg=name)
        actions = random_actions(generator, 3, short.single_action_space.n)
        info, full = short.step(actions)[4], described.step(actions)[4]


def test_disabled_autoreset_resets_only_the_masked_tracks():
    env = HybridTrackVectorEnv(
        3,
        autoreset_mode="Disabled",
        tick_info=True,
        scheme="S4 S4",
    )
    env.reset(seed=0)
    for _ in range(7):
        env.step(np.zeros(3, int))
    _, _, terminated, _, _ = env.step(np.array([0, 0, 0]))

    assert terminated.all()
    with pytest.raises(gym.error.ResetNeeded, match="reset_mask"):
        env.step(np.zeros(3, int))
    mask = np.array([True, False, True])
    _, info = env.reset(options={"reset_mask": mask})
    np.testing.assert_array_equal(info["_tick"], mask)
    assert info["tick"].tolist() == [1, 0, 1]
    for bad in (np.array([True]), np.array([1, 0, 1]), np.zeros(3, bool)):
        with pytest.raises(ValueError, match="reset_mask"):
            env.reset(options={"reset_mask": bad})


def test_the_first_reset_must_include_all_tracks():
    env = HybridTrackVectorEnv(3, autoreset_mode="Disabled")
    with pytest.raises(gym.error.ResetNeeded, match="requires an earlier reset"):
        env.reset(
            seed=0,
            options={"reset_mask": np.array([True, False, False])},
        )


def test_an_environment_unpickled_from_read_only_buffers_steps_in_its_own_memory():
    env = HybridTrackVectorEnv(3, trace_rows=4)
    env.reset(seed=5)
    buffers = []
    data = pickle.dumps(env, protocol=5, buffer_callback=buffers.append)
    frozen = [bytes(buffer.raw()) for buffer in buffers]
    before = [bytes(buffer) for buffer in frozen]
    again = pickle.loads(data, buffers=frozen)
    for _ in range(20):
        rows = [each.step(np.zeros(3, np.int64))[0] for each in (env, again)]
        np.testing.assert_array_equal(*rows)

    assert frozen == before


@pytest.mark.parametrize(
    ("make", "options"),
    [
        (HybridTrackVectorEnv, {"scheme": "random 3x5-20"}),
        (HybridTrackVectorEnv, {"scheme": "random 3x5-20", "bank": "anchor_aware"}),
        (HybridTrackQuickestVectorEnv, SHORT),
    ],
)
@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_results_do_not_depend_on_threads(make, options, mode):
    tracks = 61
    generator = np.random.default_rng(4)
    options = options | {"measurement_variance": (0.1, 0.2), "autoreset_mode": mode}
    alone, together = (
        make(
            tracks,
            threads=threads,
            tick_info=True,
            **options,
        )
        for threads in (1, 3)
    )

    np.testing.assert_array_equal(
        alone.reset(seed=1)[0],
        together.reset(seed=1)[0],
    )
    for _ in range(150):
        actions = random_actions(
            generator,
            tracks,
            alone.single_action_space.n,
        )
        *arrays, info = alone.step(actions)
        *others, other_info = together.step(actions)
        for array, other in zip(arrays, others, strict=True):
            np.testing.assert_array_equal(array, other)
        compare_infos(info, other_info)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_a_forked_process_starts_its_own_threads():
    env = HybridTrackVectorEnv(40, threads=2)
    env.reset(seed=0)
    wait = np.zeros(40, np.int64)
    env.step(wait)
    child = os.fork()
    if child == 0:
        # A hanging child ends with a signal.
        signal.alarm(20)
        env.step(wait)
        os._exit(0)

    assert os.waitpid(child, 0)[1] == 0
    env.close()
    # Starts the threads again.
    env.world.step()


def test_an_invalid_action_in_one_thread_steps_no_track():
    env, same = (HybridTrackVectorEnv(40, threads=2) for _ in range(2))
    rows = env.reset(seed=0)[0]
    same.reset(seed=0)
    actions = np.zeros(40, np.int64)
    actions[33] = 9
    with pytest.raises(gym.error.InvalidAction, match="action=9"):
        env.step(actions)

    np.testing.assert_array_equal(env.world.observations, rows)
    np.testing.assert_array_equal(
        env.step(actions * 0)[0],
        same.step(actions * 0)[0],
    )
