"""Values and files that once gave a traceback, a wrong step or half a result."""

import errno
import warnings

import numpy as np
import pytest

from agents import track_recording
from agents.cli import main
from baselines.rules.rollout import evaluate
from hybrid_env import ArgumentError, HybridTrackEnv
from hybrid_env.wrappers import CompleteInfo


@pytest.mark.parametrize(
    ("length", "time"),
    [(1e-160, 1.0), (1e-300, 1.0), (1e160, 1.0), (1.0, 1e-160), (1.0, 1e-300), (1.0, 1e160)],
)
def test_recordings_beyond_all_units_are_refused(length, time):
    positions = np.cumsum(
        np.random.default_rng(0).normal(size=(100, 2)),
        axis=0,
    )
    with pytest.raises(ArgumentError) as found:
        track_recording(time * np.arange(100), length * positions)

    assert "\n" not in str(found.value)


def test_results_of_a_recording_appear_together_or_not_at_all(tmp_path, monkeypatch, capsys):
    path = tmp_path / "flight.csv"
    times = np.arange(60)
    path.write_text("t,x,y\n" + "\n".join(f"{t},{2.0 * t},{0.1 * t * t}" for t in times))

    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("agents.commands.track.row_table", full)
        assert main(["track", str(path), "--no-picture"]) == 2

    assert [one.name for one in tmp_path.iterdir()] == ["flight.csv"]
    lines = [line for line in capsys.readouterr().err.splitlines() if "compiling" not in line]
    assert len(lines) == 1
    assert main(["track", str(path), "--no-picture"]) == 0
    assert {one.name for one in (tmp_path / "flight_track").iterdir()} == {
        "modes.csv",
        "estimates.csv",
    }


def test_a_model_that_is_evaluated_elsewhere_than_it_was_trained_is_said():
    from stable_baselines3 import PPO

    model = PPO("MlpPolicy", "hybrid_env:HybridTrack-v0", n_steps=8, batch_size=8, device="cpu")
    with pytest.warns(
        UserWarning,
        match=r"trained in HybridTrack-v0 and is evaluated in HybridTrackPublished-v0",
    ):
        evaluate(model, "hybrid_env:HybridTrackPublished-v0", episodes=2)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        evaluate(model, "hybrid_env:HybridTrack-v0", episodes=2)
    with pytest.raises(ArgumentError, match="observation shape"):
        evaluate(model, "hybrid_env:HybridTrack-v0", episodes=2, radii=(2.0, 5.0))


def test_a_recorder_sees_the_same_info_at_every_step():
    env = CompleteInfo(HybridTrackEnv(scheme="S5 L5r5"))
    _, info = env.reset(seed=0)
    kinds = {name: (np.shape(value), np.asarray(value).dtype) for name, value in info.items()}
    done = False
    decided = 0
    while not done:
        _, _, done, _, info = env.step(0)
        decided += info["decided_mode"] >= 0
        assert {
            name: (np.shape(value), np.asarray(value).dtype) for name, value in info.items()
        } == kinds

    assert decided == 2
