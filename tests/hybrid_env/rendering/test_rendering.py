import copy
import time
from itertools import combinations, pairwise

import gymnasium as gym
import numpy as np
import pytest

import hybrid_env  # noqa: F401
from hybrid_env.rendering.figure import FRAME_SIZE, RENDER_FPS, EpisodeFigure, Renderer
from hybrid_env.rendering.modes import TYPE_COLOURS, mode_colour, mode_name
from hybrid_env.rendering.window import NoDisplayError, display_available

RADII = tuple(float(radius) for radius in range(1, 11))
WIDTH, HEIGHT = FRAME_SIZE
SHADE = np.array([237, 237, 237])  # black at 7 % on white


def make(render_mode="rgb_array", **options):
    return gym.make("HybridTrack-v0", render_mode=render_mode, **options).unwrapped


def rgb(colour):
    return np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)])


def has_colour(pixels, colour):
    return (np.abs(pixels.astype(int) - rgb(colour)).max(-1) <= 2).any()


def play(env, seed, wait_probability=0.9):
    """A random episode: everything that `reset` and `step` told."""
    rng = np.random.default_rng(seed)
    infos = [env.reset(seed=seed)[1]]
    terminated = False
    while not terminated:
        wait = rng.random() < wait_probability
        action = 0 if wait else int(rng.integers(1, env.action_space.n))
        _, _, terminated, _, info = env.step(action)
        infos.append(info)
    return infos


def drawn_texts(figure):
    yield from figure.texts
    for legend in figure.legends:
        yield from legend.get_texts()
    for axes in figure.axes:
        yield from axes.texts
        for axis in (axes.xaxis, axes.yaxis):
            yield axis.label
            low, high = axis.get_view_interval()
            for place, label in zip(axis.get_majorticklocs(), axis.get_majorticklabels(), strict=True):
                if low <= place <= high:
                    yield label


def test_a_frame_is_an_rgb_picture():
    env = make()
    env.reset(seed=0)
    frame = env.render()
    assert frame.shape == (HEIGHT, WIDTH, 3)
    assert frame.dtype == np.uint8
    assert env.metadata["render_fps"] == RENDER_FPS == 10


def test_every_frame_is_a_fresh_array():
    env = make()
    env.reset(seed=0)
    first, second = env.render(), env.render()
    assert np.array_equal(first, second)
    second[:] = 0
    assert np.array_equal(first, env.render())


def test_a_step_changes_the_frame():
    env = make()
    env.reset(seed=0)
    before = env.render()
    env.step(0)
    assert not np.array_equal(before, env.render())


def test_a_frame_does_not_depend_on_the_frames_before_it():
    often, once = make(), make()
    for env in (often, once):
        env.reset(seed=0)
        terminated = False
        for action in [0] * 20 + [2] + [0] * 20 + [1, 1, 1, 1, 1]:
            terminated = env.step(action)[2]
            if env is often:
                env.render()
        assert terminated
    assert np.array_equal(often.render(), once.render())


def test_the_history_holds_every_tick_of_the_episode_once():
    env, waiting = make(), make(render_mode=None)
    infos = play(env, seed=3)
    # truth and noise do not depend on the decisions, so an env that only waits shows all of them
    truths, measurements, lengths = [], [], []
    for info in play(waiting, seed=3, wait_probability=1.0):
        if "decided_mode" in info:
            lengths.append(info["decided_length"])
        if len(lengths) < env.options.segments:  # the last step decides and moves no further
            truths.append(info["truth"])
            measurements.append(info["measurement"])
    trace = env.history.trace
    assert len(infos) < sum(lengths) == len(trace)
    np.testing.assert_array_equal(trace[:, :4], truths)
    np.testing.assert_array_equal(trace[:, 4:6], measurements)
    np.testing.assert_array_equal(env.history.switches, np.cumsum([0, *lengths])[:-1])


def test_the_history_forgets_the_episode_before():
    env = make()
    play(env, seed=3)
    env.reset()
    assert len(env.history.trace) == 1
    assert env.history.decisions == []
    assert not env.history.finished


def test_ratios_are_those_of_info_and_end_with_the_decision():
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
    np.testing.assert_array_equal(env.history.ratios, expected)
    made = [info for info in infos if "decided_mode" in info]
    assert [(d.mode, d.true_mode, d.correct, d.ticks) for d in env.history.decisions] == [
        (info["decided_mode"], info["decided_true_mode"], info["correct"], info["ticks"]) for info in made
    ]
    starts = np.cumsum([0] + [info["decided_length"] for info in made])
    for decision, start in zip(env.history.decisions, starts, strict=False):
        assert decision.time == start + decision.ticks
        assert decision.ratio == env.history.ratios[decision.time - 1, decision.mode]


def test_the_evidence_has_a_gap_after_every_decision():
    env = make(scheme="S60 L60r5 S60")
    env.reset(seed=0)
    for action in [*[0] * 20, 1, *[0] * 20, 2, *[0] * 20, 1]:
        env.step(action)
    panel = env.render()[45:325, 510:866]
    shaded = np.abs(panel[4].astype(int) - SHADE).max(-1) <= 2
    assert 0.6 < shaded.mean() < 0.75  # 39 of 60 ticks
    runs = np.flatnonzero(np.diff(np.r_[0, shaded, 0]))
    for start, end in zip(runs[::2], runs[1::2], strict=True):
        inside = panel[:, start + 8 : end - 8]  # markers reach into it
        assert inside.size
        assert not any(has_colour(inside, colour) for colour in TYPE_COLOURS)
    assert any(has_colour(panel[:, ~shaded], colour) for colour in TYPE_COLOURS)


@pytest.mark.parametrize("declared", [0, 1, 2])
def test_the_estimate_has_the_colour_of_the_decided_mode(declared):
    env = make(scheme="S60")
    env.reset(seed=0)
    env.step(declared + 1)
    track = env.render()[45:325, 70:426]
    for mode, colour in enumerate(TYPE_COLOURS):
        assert has_colour(track, colour) == (mode == declared)


def test_a_circle_is_as_wide_as_it_is_high():
    env = make(scheme="L200r5", measurement_variance=1e-6, process_variance=0.0, initial_error=0)
    env.reset(seed=0)
    env.step(2)
    track = env.render()[45:325, 70:426].astype(int)
    rows, columns = np.nonzero(np.abs(track - 0xB4).max(-1) <= 2)
    assert np.ptp(rows) > 150
    assert np.ptp(columns) == pytest.approx(np.ptp(rows), rel=0.02)


def test_wrong_and_correct_decisions_differ_in_more_than_colour():
    shapes = []
    for scheme in ("S60", "L60r5"):
        env = make(scheme=scheme)
        env.reset(seed=0)
        env.step(1)
        panel = env.render()[:, 500:].astype(int)
        shapes.append(np.abs(panel - rgb(TYPE_COLOURS[0])).max(-1)[45:325] <= 2)
    assert shapes[0].any()
    assert shapes[1].any()
    assert not np.array_equal(*shapes)


@pytest.mark.parametrize("radii", [(5.0,), (3.0, 4.0, 5.0), RADII, tuple(np.linspace(1, 50, 50).tolist())])
def test_no_two_texts_overlap_and_all_are_inside_the_frame(radii):
    env = make(radii=radii, correctness="type")
    play(env, seed=1)
    painter = EpisodeFigure(env.options)
    painter.paint(env.history)
    boxes = {text: text.get_window_extent() for text in drawn_texts(painter.figure)}
    assert len(boxes) > 25
    for text, box in boxes.items():
        assert box.x0 >= 0, text
        assert box.x1 <= WIDTH, text
        assert box.y0 >= 0, text
        assert box.y1 <= HEIGHT, text
    for (one, box), (other, other_box) in combinations(boxes.items(), 2):
        assert not box.overlaps(other_box), (one, other)


def test_a_copied_renderer_draws_the_same_frame():
    env = make()
    env.reset(seed=0)
    frame = env.render()
    assert np.array_equal(copy.deepcopy(env.renderer).draw(copy.deepcopy(env.history)), frame)


def test_modes_are_named_by_type_and_radius():
    assert [mode_name(mode, (5.0,)) for mode in range(3)] == ["S", "L r=5 m", "R r=5 m"]
    assert [mode_name(mode, (3.0, 4.5)) for mode in (1, 2, 3, 4)] == [
        "L r=3 m", "L r=4.5 m", "R r=3 m", "R r=4.5 m",
    ]  # fmt: skip


def test_every_mode_of_a_bank_has_its_own_colour_darker_for_a_tighter_turn():
    assert tuple(mode_colour(mode, (5.0,)) for mode in range(3)) == TYPE_COLOURS
    assert len({mode_colour(mode, RADII) for mode in range(21)}) == 21
    left = [rgb(mode_colour(mode, RADII)).sum() for mode in range(1, 11)]
    assert all(tighter < wider for tighter, wider in pairwise(left))
    assert mode_colour(1, (9.0, 2.0)) == mode_colour(2, (2.0, 9.0))


@pytest.mark.parametrize("mode", [-1, 3])
@pytest.mark.parametrize("function", [mode_name, mode_colour])
def test_a_mode_that_the_bank_lacks_is_refused(function, mode):
    with pytest.raises(ValueError, match=rf"mode={mode} is not allowed: expected an integer from 0 to 2"):
        function(mode, (5.0,))


def test_rendering_without_a_render_mode_warns():
    env = make(render_mode=None)
    env.reset(seed=0)
    with pytest.warns(UserWarning, match="render_mode='rgb_array'"):
        assert env.render() is None


def test_human_mode_shows_ten_frames_a_second(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    env = make(render_mode="human")
    env.reset(seed=0)
    begin = time.perf_counter()
    for _ in range(4):
        env.step(0)
    passed = time.perf_counter() - begin
    assert env.render() is None
    env.close()
    env.close()
    assert passed > 0.3


def test_the_window_shows_the_frame(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    import pygame

    env, picture = make(render_mode="human"), make()
    env.reset(seed=0)
    picture.reset(seed=0)
    shown = pygame.surfarray.array3d(pygame.display.get_surface()).swapaxes(0, 1)
    env.close()
    assert np.array_equal(shown, picture.render())


def test_an_episode_goes_on_unwatched_when_the_window_is_closed(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    import pygame

    env = make(render_mode="human")
    env.reset(seed=0)
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    env.step(0)
    assert env.renderer.window.closed_by_user
    assert not pygame.display.get_init()
    begin = time.perf_counter()
    for _ in range(40):
        env.step(0)
    assert time.perf_counter() - begin < 2.0  # no longer 10 a second
    env.close()
    env.reset(seed=0)
    assert pygame.display.get_init()
    env.close()


def test_a_window_that_cannot_be_opened_is_an_error_that_says_what_to_do(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "nonsense")
    assert not display_available()
    env = make(render_mode="human")
    with pytest.raises(NoDisplayError, match="use render_mode='rgb_array'"):
        env.reset(seed=0)
    env.close()


def test_a_display_is_known_to_be_missing(monkeypatch):
    monkeypatch.setattr("sys.platform", "linux")
    for name in ("SDL_VIDEODRIVER", "SDL_VIDEO_DRIVER", "DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    assert not display_available()
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    assert display_available()


def test_a_frame_takes_well_below_the_time_between_frames():
    env = make(radii=RADII, correctness="type")
    play(env, seed=1)
    env.render()
    begin = time.perf_counter()
    for _ in range(5):
        env.render()
    assert (time.perf_counter() - begin) / 5 < 0.1


def test_a_renderer_without_a_window_closes_quietly():
    Renderer(make().options, human=False).close()
