"""The command `hybridtrack play`: animations, pictures, tables, recordings and the window."""

import csv

import gymnasium as gym
import numpy as np
import pytest
from PIL import Image

import hybrid_env  # noqa: F401
from agents.commands import play as play_command
from agents.commands.play import Play
from agents.evaluation.registry import load_decider
from baselines.recordings.reading.read import read_recordings
from baselines.rules.external import as_decider
from hybrid_env.checks import ArgumentError
from hybrid_env.rendering import FRAME_SIZE

SCHEME = "S8 L8r5"
# fixed:5 waits for four ticks of each segment and declares at the fifth.
STEPS = 10
DECLARED, STATED = "hybrid_env:HybridTrackPublished-v0", "hybrid_env:HybridTrackQuickest-v0"
OPTIONS = {DECLARED: {"scheme": SCHEME}, STATED: {"ticks": 40, "durations": "uniform 10-15"}}


class Decider:
    """Always waits, and calls a function at one step of the episode."""

    def __init__(self, step, act):
        self.step, self.act, self.calls = step, act, 0

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        self.calls += 1
        if self.calls == self.step:
            self.act()
        return np.zeros(len(observation), np.int64), state


def fail():
    raise RuntimeError("decider failed")


def play(env=None, **arguments):
    if env != STATED:
        arguments = {"scheme": SCHEME, "decider": "fixed:5"} | arguments
        env = env or DECLARED
    Play(**{"env": env, "seed": 3} | OPTIONS.get(env, {}) | arguments).run()


def environment(env_id, **options):
    return gym.make(env_id, render_mode="rgb_array", **OPTIONS[env_id], **options).unwrapped


def played(env_id, name):
    """The environment after the episode of a decider, its panel, and the statements and true
    modes.
    """
    env = environment(env_id)
    decider = load_decider(name, env.options)
    _, info = env.reset(seed=3)
    state = None
    start = np.ones(1, np.bool_)
    terminated = False
    modes = []
    while not terminated:
        rows = decider.observe(env.world).copy()
        env.history.set_evidence(decider.evidence(rows, state, start)[0])
        actions, state = decider.predict(rows, state, start)
        modes.append((int(actions[0]), info["true_mode"]))
        _, _, terminated, _, info = env.step(actions[0])
        start = np.zeros(1, np.bool_)
    return env, decider.panel(), *np.array(modes).T


def use(monkeypatch, decider):
    monkeypatch.setattr(play_command, "load_decider", lambda *_: as_decider(decider))


def test_a_gif_has_one_frame_for_each_reset_and_step(tmp_path):
    play(out=tmp_path / "episode.gif", episodes=2)
    with Image.open(tmp_path / "episode.gif") as animation:
        assert animation.n_frames == 2 * (1 + STEPS)
        assert animation.size == FRAME_SIZE

    assert [path.name for path in tmp_path.iterdir()] == ["episode.gif"]
    play(out=tmp_path / "statements.gif", env=STATED)
    with Image.open(tmp_path / "statements.gif") as animation:
        assert animation.n_frames == 40 + 1


@pytest.mark.parametrize(
    ("env_id", "name"),
    [
        *((DECLARED, name) for name in ("ate:1e-6", "fixed:5", "shipped")),
        *((STATED, name) for name in ("threshold:0.7", "beam")),
    ],
)
def test_a_png_shows_the_finished_episode_with_the_evidence_of_the_decider(tmp_path, env_id, name):
    play(out=tmp_path / "episode.png", env=env_id, decider=name)
    env, panel, stated, true = played(env_id, name)
    if env_id == STATED:
        np.testing.assert_array_equal(env.history.stated, stated)
        np.testing.assert_array_equal(env.history.true_modes, true)
    env.history.panel = panel
    frame = env.history.draw()
    with Image.open(tmp_path / "episode.png") as picture:
        np.testing.assert_array_equal(np.asarray(picture), frame)


@pytest.mark.parametrize(
    ("env_id", "tau"),
    [
        (DECLARED, 0.1),
        (STATED, 0.2),
    ],
)
def test_the_recording_contains_every_measurement_with_its_time(tmp_path, env_id, tau):
    play(
        env=env_id,
        out=tmp_path / "episode.png",
        record=tmp_path / "episode.csv",
        tau=tau,
    )
    with (tmp_path / "episode.csv").open(newline="") as file:
        rows = list(csv.reader(file))

    assert rows[0] == ["t", "x", "y"]
    assert [row[0] for row in rows[1:4]] == [f"{tau * tick:g}" for tick in (1, 2, 3)]
    env = environment(env_id, tau=tau)
    _, info = env.reset(seed=3)
    measured = []
    terminated = False
    # Truth and noise do not depend on the decisions.
    while not terminated:
        measured.append(info["measurement"])
        _, _, terminated, _, info = env.step(0)
    [recording] = read_recordings(tmp_path / "episode.csv").recordings
    np.testing.assert_array_equal(recording.positions, measured)
    np.testing.assert_allclose(
        recording.times,
        tau * np.arange(1, len(measured) + 1),
    )
    assert recording.tick == pytest.approx(tau)


@pytest.mark.parametrize("name", ["episode.gif"])
def test_an_error_during_the_episode_keeps_the_old_file_and_leaves_no_other(
    tmp_path,
    monkeypatch,
    name,
):
    use(monkeypatch, Decider(4, fail))
    (tmp_path / name).write_bytes(b"old")
    with pytest.raises(ArgumentError, match=r"failed in .*decider failed"):
        play(out=tmp_path / name, record=tmp_path / "episode.csv")

    assert [path.name for path in tmp_path.iterdir()] == [name]
    assert (tmp_path / name).read_bytes() == b"old"


def test_closing_the_window_ends_the_command(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    import pygame

    decider = Decider(
        2,
        lambda: pygame.event.post(pygame.event.Event(pygame.QUIT)),
    )
    use(monkeypatch, decider)
    play()

    assert decider.calls == 2
    assert not pygame.display.get_init()
