"""The window of render_mode="human"."""

import sys

import gymnasium as gym
import numpy as np
import pytest

from hybrid_env import WorldOptions, extras
from hybrid_env.rendering.evidence import probability_panel
from hybrid_env.rendering.window import NoDisplayError, Renderer, display_available


def make(render_mode):
    return gym.make("HybridTrackPublished-v0", render_mode=render_mode).unwrapped


@pytest.mark.parametrize(
    ("module", "mode"),
    [
        ("pygame", "human"),
        ("hybrid_env.rendering.figure", "rgb_array"),
    ],
)
def test_what_is_not_installed_is_named_with_its_extra(module, mode, monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    monkeypatch.setitem(sys.modules, module, None)
    monkeypatch.setattr(extras, "extra_of", lambda name: "play")
    renderer = Renderer(WorldOptions(), mode == "human", probability_panel("bank"))
    with pytest.raises(extras.MissingExtraError, match=r"needs the extra \[play\]: pip install "):
        renderer.draw(None)


def test_the_window_shows_the_frame(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    import pygame

    env = make("human")
    reference = make("rgb_array")
    env.reset(seed=0)
    reference.reset(seed=0)
    shown = pygame.surfarray.array3d(pygame.display.get_surface()).swapaxes(0, 1)
    env.close()

    assert np.array_equal(shown, reference.render())


def test_the_episode_continues_after_the_window_is_closed(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    import pygame

    env = make("human")
    env.reset(seed=0)
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    env.step(0)

    assert env.renderer.window.closed_by_user
    assert not pygame.display.get_init()
    env.step(0)
    env.close()
    env.reset(seed=0)
    assert pygame.display.get_init()
    env.close()


def test_the_error_for_a_window_that_cannot_be_opened_names_the_alternative(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "nonsense")
    assert not display_available()
    env = make("human")
    with pytest.raises(NoDisplayError, match="use render_mode='rgb_array'"):
        env.reset(seed=0)
    env.close()
