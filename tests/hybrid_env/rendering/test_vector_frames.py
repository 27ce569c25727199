"""A frame of a vector environment shows its first four tracks, each as a single environment
shows it.
"""

import copy

import gymnasium as gym
import numpy as np
import pytest
from hostile_input import refused

import hybrid_env
from hybrid_env import (
    HybridTrackEnv,
    HybridTrackQuickestEnv,
    HybridTrackQuickestVectorEnv,
    HybridTrackVectorEnv,
)
from hybrid_env.rendering import FRAME_SIZE

WIDTH, HEIGHT = FRAME_SIZE
KINDS = {
    "announced": (
        HybridTrackVectorEnv,
        HybridTrackEnv,
        {
            "scheme": "S5 L6r5",
            "evidence": 0.5,
            "bank": "anchor_aware",
        },
    ),
    "unknown": (HybridTrackQuickestVectorEnv, HybridTrackQuickestEnv, {"ticks": 9}),
}
PLACES = [
    (row, column)
    for row in (slice(0, HEIGHT), slice(HEIGHT, None))
    for column in (slice(0, WIDTH), slice(WIDTH, None))
]


@pytest.mark.parametrize(
    ("tracks", "rows", "columns"),
    [(1, 1, 1), (2, 1, 2), (3, 2, 2), (4, 2, 2), (6, 2, 2)],
)
def test_a_frame_has_places_for_up_to_four_tracks(tracks, rows, columns):
    env = HybridTrackVectorEnv(tracks, render_mode="rgb_array")
    env.reset(seed=0)
    frame = env.render()

    assert (frame.shape, frame.dtype) == ((rows * HEIGHT, columns * WIDTH, 3), np.uint8)
    shown = [not (frame[place] == 255).all() for place in PLACES if frame[place].size]
    assert shown == [True] * min(tracks, 4) + [False] * (tracks == 3)


@pytest.mark.parametrize("kind", KINDS)
def test_every_place_equals_the_frame_of_a_single_environment_across_autoresets(kind):
    vector, single, options = KINDS[kind]
    tracks = 5
    seed = 4
    env = vector(tracks, render_mode="rgb_array", **options)
    singles = [single(render_mode="rgb_array", **options) for _ in range(4)]
    env.reset(seed=seed)
    for track, one in enumerate(singles):
        one.reset(seed=seed + track)
    generator = np.random.default_rng(0)
    done = np.zeros(tracks, bool)
    resets = pictures = 0
    for step in range(24):
        actions = np.where(
            generator.random(tracks) < 0.2,
            generator.integers(1, 3, tracks),
            0,
        )
        for track, one in enumerate(singles):
            if done[track]:
                one.reset()
                resets += 1
            else:
                one.step(actions[track])
        done = env.step(actions)[2]
        ends = done[:4].any()
        # One with the end of an episode, one of later episodes.
        if (ends and pictures == 0) or step == 23:
            pictures += 1
            frame = env.render()
            for place, one in zip(PLACES, singles, strict=True):
                np.testing.assert_array_equal(frame[place], one.render())

    assert resets >= 4
    assert pictures == 2


@pytest.mark.parametrize("kind", KINDS)
def test_with_resets_in_the_same_step_a_frame_shows_the_new_episode(kind):
    vector, _, options = KINDS[kind]
    env = vector(2, autoreset_mode="SameStep", render_mode="rgb_array", **options)
    env.reset(seed=4)
    done = np.zeros(2, bool)
    while not done.any():
        done = env.step(np.zeros(2, np.int64))[2]
    lengths = [len(scene.history.trace) for scene in env._scenes]

    assert lengths == [1, 1]
    assert not any(scene.history.finished for scene in env._scenes)
    assert env.render().shape == (HEIGHT, 2 * WIDTH, 3)


def test_a_reset_of_some_tracks_begins_their_pictures_anew():
    env = HybridTrackVectorEnv(2, autoreset_mode="Disabled", render_mode="rgb_array", scheme="S9")
    env.reset(seed=0)
    for _ in range(3):
        env.step(np.zeros(2, np.int64))
    before = env.render()
    env.reset(options={"reset_mask": np.array([True, False])})
    after = env.render()

    assert (after[:, :WIDTH] != before[:, :WIDTH]).any()
    np.testing.assert_array_equal(after[:, WIDTH:], before[:, WIDTH:])


@pytest.mark.parametrize("env_id", tuple(hybrid_env.ENVIRONMENTS))
def test_every_id_makes_vector_environments_that_render(env_id):
    env = gym.make_vec(env_id, 2, render_mode="rgb_array")
    assert env.render_mode == "rgb_array"
    env.reset(seed=0)
    again = copy.deepcopy(env)
    env.step(np.array([0, 1]))
    again.step(np.array([0, 1]))
    np.testing.assert_array_equal(env.render(), again.render())


def test_rendering_does_not_change_the_episodes():
    plain = HybridTrackVectorEnv(3)
    shown = HybridTrackVectorEnv(3, render_mode="rgb_array")

    np.testing.assert_array_equal(
        plain.reset(seed=1)[0],
        shown.reset(seed=1)[0],
    )
    for k in range(40):
        actions = np.full(3, 2 * (k % 9 == 8))
        shown.render() if k % 20 == 0 else None
        for one, other in zip(
            plain.step(actions)[:4],
            shown.step(actions)[:4],
            strict=True,
        ):
            np.testing.assert_array_equal(one, other)


def test_a_frame_needs_an_episode_and_a_render_mode():
    env = HybridTrackVectorEnv(2, render_mode="rgb_array")
    with pytest.raises(gym.error.ResetNeeded, match="call reset"):
        env.render()
    env = HybridTrackVectorEnv(2)
    env.reset(seed=0)
    with pytest.warns(UserWarning, match="render_mode='rgb_array'"):
        assert env.render() is None
    for mode in ("human", "ansi", 3):
        assert refused(HybridTrackVectorEnv, render_mode=mode).startswith("render_mode=")
