"""The command `hybridtrack play`: animations, pictures, tables, recordings and the window."""

import gymnasium as gym
import numpy as np
import pytest
from PIL import Image

import hybrid_env  # noqa: F401
from agents import task_of
from agents.commands.play import Play
from agents.evaluation import episodes as episodes_of
from agents.evaluation.registry import load_decider
from baselines.recordings.reading.read import read_recordings
from baselines.rules.external import as_decider
from baselines.rules.rollout import record_decisions
from baselines.scoring.timelines import NO_MODE

# fixed:5 waits for four ticks of each segment and declares at the fifth.
STEPS = 10
DECLARED, STATED = "hybrid_env:HybridTrackPublished-v0", "hybrid_env:HybridTrackQuickest-v0"
OPTIONS = {DECLARED: {"scheme": "S8 L8r5"}, STATED: {"ticks": 40, "durations": "uniform 10-15"}}


class Decider:
    """Always waits, and calls a function at one step of the episode."""

    def __init__(self, step, act):
        self.step, self.act, self.calls = step, act, 0

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        self.calls += 1
        if self.calls == self.step:
            self.act()
        return np.zeros(len(observation), np.int64), state


def play(env=DECLARED, **arguments):
    decider = "threshold" if env == STATED else "fixed:5"
    Play(env=env, seed=3, deciders=(decider,), **OPTIONS[env], **arguments).run()


def use(monkeypatch, decider):
    monkeypatch.setattr(episodes_of, "load_decider", lambda *_: as_decider(decider))


def test_a_gif_has_one_frame_for_each_reset_and_step(tmp_path):
    play(out=tmp_path / "episode.gif", episodes=2)

    with Image.open(tmp_path / "episode.gif") as animation:
        assert animation.n_frames == 2 * (1 + STEPS)


@pytest.mark.parametrize(("env_id", "tau"), [(DECLARED, 0.1), (STATED, 0.2)])
def test_the_recording_contains_every_measurement_with_its_time(tmp_path, env_id, tau):
    play(env=env_id, out=tmp_path / "episode.png", record=tmp_path / "episode.csv", tau=tau)
    env = gym.make(env_id, tau=tau, **OPTIONS[env_id])
    _, info = env.reset(seed=3)
    measured = []
    terminated = False
    # Truth and noise do not depend on the decisions.
    while not terminated:
        measured.append(info.get("measurement", (np.nan, np.nan)))
        _, _, terminated, _, info = env.step(0)
    [recording] = read_recordings(tmp_path / "episode.csv").recordings
    np.testing.assert_array_equal(recording.positions, measured)
    np.testing.assert_allclose(recording.times, tau * np.arange(1, len(measured) + 1))


def test_closing_the_window_ends_the_command(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    import pygame

    decider = Decider(2, lambda: pygame.event.post(pygame.event.Event(pygame.QUIT)))
    use(monkeypatch, decider)
    play()

    assert decider.calls == 2
    assert not pygame.display.get_init()


@pytest.mark.parametrize(
    ("name", "env_id"),
    [
        ("shipped", "hybrid_env:HybridTrack-v0"),
        ("msprt", "hybrid_env:HybridTrack-v0"),
        ("ate:1e-3", DECLARED),
    ],
)
def test_an_episode_is_the_one_that_is_evaluated(name, env_id):
    """Also of a decider that reads every tick, where a decision is asked for every few ticks."""
    task = task_of(env_id, {"scheme": "S20 L25r5 S20"})
    episodes = episodes_of.Episodes(task, name)
    list(episodes.play(3))
    history, shown = episodes.history, episodes_of.timeline(task, episodes.history)
    decider = load_decider(name, task.options)
    expected = record_decisions(decider, task.env_id, 1, 3, **task.given)

    assert sum(reward for _, reward in episodes.rewards) == pytest.approx(expected.reward.sum())
    np.testing.assert_array_equal(shown["right"][shown["marks"]], expected.correct[0])
    lengths = np.diff([*history.switches, len(history.points())])
    np.testing.assert_array_equal(lengths, expected.length[0])
    undecided = np.add.reduceat(shown["modes"] == NO_MODE, history.switches)
    np.testing.assert_array_equal(undecided, expected.ticks[0])
    error = history.points("estimate_") - history.points()
    assert (error**2).sum() == pytest.approx(expected.squared_error.sum())
