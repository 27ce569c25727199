"""Frames of an episode, and the history that they show."""

import copy
import subprocess
import sys

import gymnasium as gym
import numpy as np
import pytest

import hybrid_env  # noqa: F401
from hybrid_env.rendering import FRAME_SIZE
from hybrid_env.rendering.evidence import TYPE_COLOURS
from hybrid_env.rendering.window import RENDER_FPS

WIDTH, HEIGHT = FRAME_SIZE
# Black at 7 % on white.
SKIPPED = np.array([237, 237, 237])
# Pixels inside the panel.
EVIDENCE = np.s_[45:325, 516:861]


def make(render_mode="rgb_array", **options):
    return gym.make("HybridTrackPublished-v0", render_mode=render_mode, **options).unwrapped


def rgb(colour):
    return np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)])


def pixels_of(colour, picture):
    return np.abs(picture.astype(int) - rgb(colour)).max(-1) <= 2


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
    second = env.render()

    assert first.shape == (HEIGHT, WIDTH, 3)
    assert first.dtype == np.uint8
    assert env.metadata["render_fps"] == RENDER_FPS == 10
    assert np.array_equal(first, second)
    second[:] = 0
    assert np.array_equal(first, env.render())
    assert np.array_equal(first, copy.deepcopy(env.renderer).draw(copy.deepcopy(env.history)))
    env.step(0)
    assert not np.array_equal(first, env.render())


def test_the_history_contains_every_tick_once_until_the_reset():
    env = make()
    waiting = make(render_mode=None)
    infos = play(env, seed=3)
    # Path and noise do not depend on the decisions, so an agent that only waits sees all ticks.
    truths = []
    measurements = []
    lengths = []
    for info in play(waiting, seed=3, wait_probability=1.0):
        if "decided_mode" in info:
            lengths.append(info["decided_length"])
        # The last step contains no new tick.
        if len(lengths) < env.options.segments:
            truths.append(info["truth"])
            measurements.append(info["measurement"])
    trace = env.history.trace

    assert len(infos) < sum(lengths) == len(trace)
    np.testing.assert_array_equal(trace[:, :4], truths)
    np.testing.assert_array_equal(trace[:, 4:6], measurements)
    np.testing.assert_array_equal(
        env.history.switches,
        np.cumsum([0, *lengths])[:-1],
    )
    true_modes = [decision.true_mode for decision in env.history.decisions]
    np.testing.assert_array_equal(
        env.history.true_modes,
        np.repeat(true_modes, lengths),
    )
    assert env.history.finished
    env.reset()
    assert len(env.history.trace) == len(env.history.true_modes) == 1
    assert env.history.decisions == []
    assert not env.history.finished


def test_the_evidence_is_the_log_likelihood_ratio_until_the_decision():
    env = make()
    infos = play(env, seed=5)
    expected = []
    active = 0
    for k, info in enumerate(infos):
        if "decided_mode" in info:
            active = info["decided_mode"]
            expected += [np.full(3, np.nan)] * (info["decided_length"] - info["ticks"])
        if k < len(infos) - 1:
            expected.append(info["log_likelihood"] - info["log_likelihood"][active])

    np.testing.assert_array_equal(env.history.evidence, expected)
    made = [info for info in infos if "decided_mode" in info]
    assert [(d.mode, d.true_mode, d.correct, d.ticks) for d in env.history.decisions] == [
        (info["decided_mode"], info["decided_true_mode"], info["correct"], info["ticks"])
        for info in made
    ]
    starts = np.cumsum([0] + [info["decided_length"] for info in made])
    for decision, start in zip(env.history.decisions, starts, strict=False):
        assert decision.time == start + decision.ticks
        assert decision.evidence == env.history.evidence[decision.time - 1, decision.mode]


def test_ticks_after_a_decision_are_shaded_and_have_no_evidence():
    env = make(scheme="S60 L60r5 S60")
    env.reset(seed=0)
    for action in [*[0] * 20, 1, *[0] * 20, 2, *[0] * 20, 1]:
        env.step(action)
    panel = env.render()[EVIDENCE]
    shaded = np.abs(panel[4].astype(int) - SKIPPED).max(-1) <= 2
    # 39 of 60 ticks.
    assert 0.6 < shaded.mean() < 0.75
    runs = np.flatnonzero(np.diff(np.r_[0, shaded, 0]))
    for start, end in zip(runs[::2], runs[1::2], strict=True):
        # Markers extend into it.
        inside = panel[:, start + 8 : end - 8]
        assert inside.size
        assert not any(pixels_of(colour, inside).any() for colour in TYPE_COLOURS)
    assert any(pixels_of(colour, panel[:, ~shaded]).any() for colour in TYPE_COLOURS)


def test_rendering_without_a_render_mode_warns():
    env = make(render_mode=None)
    env.reset(seed=0)
    with pytest.warns(UserWarning, match="render_mode='rgb_array'"):
        assert env.render() is None


def test_matplotlib_is_imported_with_the_first_frame_only():
    code = "import sys, hybrid_env; sys.exit('matplotlib' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)
