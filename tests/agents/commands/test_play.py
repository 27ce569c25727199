"""The command `hybridtrack play`: animations and recordings."""

import gymnasium as gym
import numpy as np
import pytest
from PIL import Image

import hybrid_env  # noqa: F401
from agents.commands.play import Play
from baselines.recordings.reading.read import read_recordings

# fixed:5 waits for four ticks of each segment and declares at the fifth.
STEPS = 10
DECLARED, STATED = "hybrid_env:HybridTrackPublished-v0", "hybrid_env:HybridTrackQuickest-v0"
OPTIONS = {DECLARED: {"scheme": "S8 L8r5"}, STATED: {"ticks": 40, "durations": "uniform 10-15"}}


def play(env=DECLARED, **arguments):
    decider = "threshold" if env == STATED else "fixed:5"
    Play(env=env, seed=3, deciders=(decider,), **OPTIONS[env], **arguments).run()


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
