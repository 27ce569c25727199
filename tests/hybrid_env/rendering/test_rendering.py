"""Frames of an episode and the history that they show, of one track and of several."""

import copy

import gymnasium as gym
import numpy as np
import pytest
from own_modes import every_mode

from hybrid_env import (
    HybridTrackEnv,
    HybridTrackQuickestEnv,
    HybridTrackQuickestVectorEnv,
    HybridTrackVectorEnv,
)
from hybrid_env.modes import Accelerate, Stop, Straight, Turn, parse_modes
from hybrid_env.rendering import FRAME_SIZE
from hybrid_env.rendering.evidence import type_colours
from hybrid_env.rendering.frame import draw_frame


def make(render_mode="rgb_array", **options):
    return HybridTrackEnv(render_mode=render_mode, **options)


def test_a_frame_is_a_new_rgb_array_that_a_step_changes():
    env = make()
    env.reset(seed=0)
    first = env.render()

    assert first.shape == (FRAME_SIZE[1], FRAME_SIZE[0], 3)
    assert first.dtype == np.uint8
    env.render()[:] = 0
    assert np.array_equal(first, env.render())
    assert np.array_equal(first, draw_frame(copy.deepcopy(env.history)))
    env.step(0)
    assert not np.array_equal(first, env.render())


KINDS = {
    "announced": (
        HybridTrackVectorEnv,
        HybridTrackEnv,
        {"scheme": "S5 L6r5", "evidence": 0.5, "bank": "anchor_aware"},
    ),
    "unknown": (HybridTrackQuickestVectorEnv, HybridTrackQuickestEnv, {"ticks": 9}),
}


@pytest.mark.parametrize("kind", KINDS)
def test_the_histories_equal_those_of_single_environments_across_autoresets(kind):
    vector, single, options = KINDS[kind]
    env = vector(2, render_mode="rgb_array", autoreset_mode="SameStep", **options)
    singles = [single(render_mode="rgb_array", **options) for _ in range(2)]
    env.reset(seed=4)
    for track, alone in enumerate(singles):
        alone.reset(seed=4 + track)
    generator = np.random.default_rng(0)
    for _ in range(24):
        actions = generator.integers(0, 3, 2) * (generator.random(2) < 0.2)
        env.step(actions)
        for history, alone, action in zip(env.histories, singles, actions, strict=True):
            if alone.step(action)[2]:
                alone.reset()
            np.testing.assert_array_equal(history.trace, alone.history.trace)
            assert history.decisions == alone.history.decisions
    assert env.histories[0].episode > 0
    for frame, alone in zip(env.render(), singles, strict=True):
        np.testing.assert_array_equal(frame, alone.render())


@pytest.mark.filterwarnings("ignore:.*human:UserWarning")
def test_the_window_of_gymnasium_shows_the_frame(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    pygame = pytest.importorskip("pygame")
    env, reference = (
        gym.make("HybridTrack-v0", render_mode=mode) for mode in ("human", "rgb_array")
    )
    env.reset(seed=0)
    reference.reset(seed=0)
    shown = pygame.surfarray.array3d(pygame.display.get_surface()).swapaxes(0, 1)
    assert np.array_equal(shown, reference.render())
    env.close()


OWN = (Straight(), Turn(5.0), Stop(), Accelerate(0.5), *every_mode()[-2:])
CLIMBS = parse_modes("straight, left 5, climb 0.5, descend 0.3")


@pytest.mark.parametrize("modes", [OWN, CLIMBS], ids=["own", "climbs"])
@pytest.mark.parametrize("env_id", ["HybridTrack-v0", "HybridTrackQuickest-v0"])
def test_modes_of_the_user_have_colours_in_a_frame(env_id, modes):
    env = gym.make(f"hybrid_env:{env_id}", modes=modes, render_mode="rgb_array")
    env.reset(seed=2)
    env.step(0)
    assert env.render().std() > 0
    assert set(type_colours(modes)) >= {mode.type for mode in modes}
