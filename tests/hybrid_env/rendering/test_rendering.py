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
from hybrid_env.modes import Accelerate, Stop, Straight, Turn
from hybrid_env.rendering import FRAME_SIZE
from hybrid_env.rendering.evidence import mode_colour, type_colours
from hybrid_env.rendering.frame import draw_frame


def make(render_mode="rgb_array", **options):
    return HybridTrackEnv(render_mode=render_mode, **options)


def play(env, seed, wait_probability=0.9):
    """Play a random episode and return all info dictionaries."""
    rng = np.random.default_rng(seed)
    infos = [env.reset(seed=seed)[1]]
    terminated = False
    while not terminated:
        wait = rng.random() < wait_probability
        action = 0 if wait else int(rng.integers(1, env.action_space.n))
        _, _, terminated, _, info = env.step(action)
        infos.append(info)
    return infos


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


def test_the_history_contains_every_tick_once_until_the_reset():
    env = make()
    infos = play(env, seed=3)
    # Path and noise do not depend on the decisions, so an agent that only waits sees all ticks.
    waited = play(make(render_mode=None), seed=3, wait_probability=1.0)
    lengths = [info["decided_length"] for info in waited if "decided_mode" in info]
    # The last step contains no new tick.
    truths = [[*info["truth"], *info["measurement"]] for info in waited[:-1]]
    history = env.history

    assert len(infos) < sum(lengths) == len(history.trace)
    np.testing.assert_array_equal(history.trace[:, :6], truths)
    np.testing.assert_array_equal(history.switches, np.cumsum([0, *lengths])[:-1])
    true_modes = [decision["decided_true_mode"] for decision in history.decisions]
    np.testing.assert_array_equal(history.true_modes, np.repeat(true_modes, lengths))
    assert history.finished
    env.reset()
    assert len(history.trace) == 1
    assert history.decisions == []


def test_the_evidence_is_the_log_likelihood_ratio_until_the_decision():
    env = make()
    infos = play(env, seed=5)
    expected = []
    active = 0
    for info in infos[:-1]:
        if "decided_mode" in info:
            active = info["decided_mode"]
            expected += [np.full(3, np.nan)] * (info["decided_length"] - info["ticks"])
        expected.append(info["log_likelihood"] - info["log_likelihood"][active])

    np.testing.assert_array_equal(env.history.evidence[: len(expected)], expected)


def test_a_curve_joins_the_decisions_of_a_segment_and_ends_with_the_last():
    env = make(decide_every=5, scheme="S20 L20r5")
    env.reset(seed=0)
    env.step(0)
    env.step(1)

    assert env.history.drawn.tolist() == [4, 9, 19, 24]
    assert env.options.most_ticks == 40


KINDS = {
    "announced": (
        HybridTrackVectorEnv,
        HybridTrackEnv,
        {"scheme": "S5 L6r5", "evidence": 0.5, "bank": "anchor_aware"},
    ),
    "unknown": (HybridTrackQuickestVectorEnv, HybridTrackQuickestEnv, {"ticks": 9}),
}


@pytest.mark.parametrize(("kind", "mode"), [("announced", "NextStep"), ("unknown", "SameStep")])
def test_the_histories_equal_those_of_single_environments_across_autoresets(kind, mode):
    vector, single, options = KINDS[kind]
    env = vector(2, render_mode="rgb_array", autoreset_mode=mode, **options)
    singles = [single(render_mode="rgb_array", **options) for _ in range(2)]
    env.reset(seed=4)
    for track, alone in enumerate(singles):
        alone.reset(seed=4 + track)
    generator = np.random.default_rng(0)
    done = np.zeros(2, bool)
    for _ in range(24):
        actions = generator.integers(0, 3, 2) * (generator.random(2) < 0.2)
        for track, alone in enumerate(singles):
            if done[track]:
                alone.reset()
            else:
                terminated = alone.step(actions[track])[2]
                if terminated and mode == "SameStep":
                    alone.reset()
        done = env.step(actions)[2] & (mode == "NextStep")
        for history, alone in zip(env.histories, singles, strict=True):
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


@pytest.mark.parametrize("env_id", ["HybridTrack-v0", "HybridTrackQuickest-v0"])
def test_modes_of_the_user_have_colours_in_a_frame(env_id):
    modes = (Straight(), Turn(5.0), Stop(), Accelerate(0.5), *every_mode()[-2:])
    env = gym.make(f"hybrid_env:{env_id}", modes=modes, render_mode="rgb_array")
    env.reset(seed=2)
    env.step(0)
    assert env.render().std() > 0
    assert set(type_colours(modes)) >= {mode.type for mode in modes}


def test_a_strip_below_the_plan_shows_the_heights():
    modes = "straight, left 5, right 5, climb 0.5, descend 0.3"
    env = gym.make("hybrid_env:HybridTrack-v0", modes=modes, render_mode="rgb_array").unwrapped
    env.reset(seed=1)
    for _ in range(5):
        env.step(0)
    width, height = FRAME_SIZE
    assert env.render().shape == (height, width, 3)
    history = env.history
    for line, name in zip(
        history.figure._strip.lines, ("z", "measured_z", "estimate_z"), strict=True
    ):
        np.testing.assert_array_equal(line.get_ydata(), history.column(name))
    # 48 ticks: the scatter of the measurements is that of the option.
    errors = history.column("measured_z") - history.column("z")
    assert 0.2 < errors.std() < 0.5
    colours = {mode_colour(h, env.options.all_modes) for h in range(9)}
    assert len(colours) == 9
