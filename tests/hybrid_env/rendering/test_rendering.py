"""Frames of an episode and the history that they show, of one track and of several, and the
window.
"""

import copy
import sys

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
    WorldOptions,
    extras,
)
from hybrid_env.rendering import FRAME_SIZE
from hybrid_env.rendering.evidence import EvidencePanel, probability_panel, sprt_panel
from hybrid_env.rendering.figure import EpisodeFigure
from hybrid_env.rendering.window import NoDisplayError, Renderer, display_available

WIDTH, HEIGHT = FRAME_SIZE


def make(render_mode="rgb_array", **options):
    return gym.make(
        "HybridTrackPublished-v0",
        render_mode=render_mode,
        **options,
    ).unwrapped


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

    assert first.shape == (HEIGHT, WIDTH, 3)
    assert first.dtype == np.uint8
    env.render()[:] = 0
    assert np.array_equal(first, env.render())
    assert np.array_equal(first, copy.deepcopy(env.renderer).draw(copy.deepcopy(env.history)))
    env.step(0)
    assert not np.array_equal(first, env.render())


def test_the_history_contains_every_tick_once_until_the_reset():
    env = make()
    infos = play(env, seed=3)
    # Path and noise do not depend on the decisions, so an agent that only waits sees all ticks.
    truths = []
    lengths = []
    for info in play(make(render_mode=None), seed=3, wait_probability=1.0):
        if "decided_mode" in info:
            lengths.append(info["decided_length"])
        # The last step contains no new tick.
        if len(lengths) < env.options.segments:
            truths.append([*info["truth"], *info["measurement"]])
    history = env.history

    assert len(infos) < sum(lengths) == len(history.trace)
    np.testing.assert_array_equal(history.trace[:, :6], truths)
    np.testing.assert_array_equal(history.switches, np.cumsum([0, *lengths])[:-1])
    true_modes = [decision.true_mode for decision in history.decisions]
    np.testing.assert_array_equal(history.true_modes, np.repeat(true_modes, lengths))
    assert history.finished
    env.reset()
    assert len(history.trace) == len(history.true_modes) == 1
    assert history.decisions == []
    assert not history.finished


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
    starts = np.cumsum([0] + [info["decided_length"] for info in made])
    for decision, info, start in zip(
        env.history.decisions,
        made,
        starts,
        strict=False,
    ):
        assert (decision.mode, decision.correct) == (info["decided_mode"], info["correct"])
        assert decision.time == start + decision.ticks
        assert decision.evidence == env.history.evidence[decision.time - 1, decision.mode]


POSTERIOR = EvidencePanel(
    label="posterior probability (neural network)",
    limits=(1e-7, 1.0 - 1e-7),
    scale="logit",
    thresholds={"": 1.0 - 1e-6},
    legend="1 - alpha at alpha = 1e-06",
)


@pytest.mark.parametrize("radii", [(5.0,), tuple(float(radius) for radius in range(1, 11))])
@pytest.mark.parametrize("panel", [sprt_panel(), POSTERIOR])
def test_curves_thresholds_and_legends_are_inside_the_frame(radii, panel):
    env = make(scheme="L60r5 S60", radii=radii, correctness="type")
    env.reset(seed=0)
    values = np.full(2 * len(radii) + 1, 0.2)
    env.history.set_evidence(values)
    env.step(2)
    drawn = EpisodeFigure(env.options, panel)
    drawn.draw(env.history)
    figure = drawn.figure
    lines = figure.axes[1].lines

    for level, line in zip(panel.thresholds.values(), lines, strict=False):
        assert panel.limits[0] < line.get_ydata()[0] == level < panel.limits[1]
    curves = lines[len(panel.thresholds) :]
    assert [np.asarray(curve.get_ydata())[1] for curve in curves] == values.tolist()
    for legend in figure.legends:
        box = legend.get_window_extent()
        assert (box.min >= 0).all()
        assert (box.max <= FRAME_SIZE).all()
        assert box.y1 <= min(axes.get_tightbbox().y0 for axes in figure.axes)


KINDS = {
    "announced": (
        HybridTrackVectorEnv,
        HybridTrackEnv,
        {"scheme": "S5 L6r5", "evidence": 0.5, "bank": "anchor_aware"},
    ),
    "unknown": (HybridTrackQuickestVectorEnv, HybridTrackQuickestEnv, {"ticks": 9}),
}
PLACES = [
    (row, column)
    for row in (slice(0, HEIGHT), slice(HEIGHT, None))
    for column in (slice(0, WIDTH), slice(WIDTH, None))
]


@pytest.mark.parametrize("kind", KINDS)
def test_every_place_equals_the_frame_of_a_single_environment_across_autoresets(kind):
    vector, single, options = KINDS[kind]
    tracks = 5
    env = vector(tracks, render_mode="rgb_array", **options)
    singles = [single(render_mode="rgb_array", **options) for _ in range(4)]
    env.reset(seed=4)
    for track, alone in enumerate(singles):
        alone.reset(seed=4 + track)
    generator = np.random.default_rng(0)
    done = np.zeros(tracks, bool)
    resets = pictures = 0
    for step in range(24):
        actions = np.where(
            generator.random(tracks) < 0.2,
            generator.integers(1, 3, tracks),
            0,
        )
        for track, alone in enumerate(singles):
            if done[track]:
                alone.reset()
                resets += 1
            else:
                alone.step(actions[track])
        done = env.step(actions)[2]
        # One with the end of an episode, one of later episodes.
        if (done[:4].any() and pictures == 0) or step == 23:
            pictures += 1
            frame = env.render()
            for place, alone in zip(PLACES, singles, strict=True):
                np.testing.assert_array_equal(frame[place], alone.render())

    assert resets >= 4
    assert pictures == 2


@pytest.mark.parametrize("kind", KINDS)
def test_with_resets_in_the_same_step_a_frame_shows_the_new_episode(kind):
    vector, _, options = KINDS[kind]
    env = vector(
        2,
        autoreset_mode="SameStep",
        render_mode="rgb_array",
        **options,
    )
    env.reset(seed=4)
    done = np.zeros(2, bool)
    while not done.any():
        done = env.step(np.zeros(2, np.int64))[2]

    assert [len(history.trace) for history, _ in env._scenes] == [1, 1]
    assert env.render().shape == (HEIGHT, 2 * WIDTH, 3)


def test_a_reset_of_some_tracks_begins_their_pictures_anew():
    env = HybridTrackVectorEnv(
        3,
        autoreset_mode="Disabled",
        render_mode="rgb_array",
        scheme="S9",
    )
    env.reset(seed=0)
    for _ in range(3):
        env.step(np.zeros(3, np.int64))
    before = env.render()
    env.reset(options={"reset_mask": np.array([True, False, False])})
    after = env.render()

    changed = [(after[place] != before[place]).any() for place in PLACES]
    assert changed == [True, False, False, False]
    assert (after[PLACES[3]] == 255).all()


@pytest.mark.parametrize("env_id", tuple(hybrid_env.ENVIRONMENTS))
def test_every_id_renders_without_a_change_of_its_episodes(env_id):
    plain, shown = (
        gym.make_vec(
            env_id,
            2,
            render_mode=mode,
        )
        for mode in (None, "rgb_array")
    )
    np.testing.assert_array_equal(plain.reset(seed=0)[0], shown.reset(seed=0)[0])
    again = copy.deepcopy(shown)
    actions = np.array([0, 1])
    expected = plain.step(actions)
    for env in (shown, again):
        for values, other in zip(
            expected[:4],
            env.step(actions)[:4],
            strict=True,
        ):
            np.testing.assert_array_equal(values, other)
    np.testing.assert_array_equal(shown.render(), again.render())


def test_a_frame_needs_an_episode_and_a_render_mode():
    with pytest.raises(gym.error.ResetNeeded, match="call reset"):
        HybridTrackVectorEnv(2, render_mode="rgb_array").render()
    for env in (HybridTrackVectorEnv(2), make(render_mode=None)):
        env.reset(seed=0)
        with pytest.warns(UserWarning, match="render_mode='rgb_array'"):
            assert env.render() is None
    for kind, mode in ((HybridTrackVectorEnv, "human"), (HybridTrackEnv, "ansi")):
        assert refused(kind, render_mode=mode).startswith("render_mode=")


@pytest.mark.parametrize(
    ("module", "mode"),
    [("pygame", "human"), ("hybrid_env.rendering.figure", "rgb_array")],
)
def test_what_is_not_installed_is_named_with_its_extra(module, mode, monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    monkeypatch.setitem(sys.modules, module, None)
    monkeypatch.setattr(extras, "extra_of", lambda name: "play")
    renderer = Renderer(
        WorldOptions(),
        mode == "human",
        probability_panel("bank"),
    )
    with pytest.raises(extras.MissingExtraError, match=r"needs the extra \[play\]: pip install "):
        renderer.draw(None)


def test_the_window_shows_the_frame_and_the_episode_continues_after_it_is_closed(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    import pygame

    env, reference = make("human"), make()
    env.reset(seed=0)
    reference.reset(seed=0)
    shown = pygame.surfarray.array3d(pygame.display.get_surface()).swapaxes(0, 1)
    assert np.array_equal(shown, reference.render())
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
