"""Data sets of Minari: loaded by Minari, and replayed in the environment that they name."""

import os

import numpy as np
import pytest

from agents.cli import main
from agents.studies import dataset_command

minari = pytest.importorskip("minari")
pytest.importorskip("h5py")


@pytest.fixture
def root(tmp_path, monkeypatch):
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    return tmp_path


@pytest.mark.parametrize(
    ("env_id", "rule", "flags"),
    [
        ("HybridTrackPublished-v0", "ate", "--scheme random --measurement-variance 0.5"),
        ("HybridTrackPublishedBank-v0", "msprt", "--scheme S9"),
        ("HybridTrackQuickest-v0", "threshold:0.7", "--ticks 40"),
    ],
)
def test_episodes_of_a_data_set_are_those_of_its_environment(root, capsys, env_id, rule, flags):
    command = f"dataset --env {env_id} --policies {rule} shipped random --episodes 3 {flags}"
    assert main(command.split()) == 0
    assert os.environ["MINARI_DATASETS_PATH"] == str(root)
    printed = capsys.readouterr().out.splitlines()
    assert printed[-1] == f"Data {root}"
    for name, line in zip(
        (rule.replace(":0.7", "_0_7"), "shipped", "random"),
        printed[:-1],
        strict=True,
    ):
        data = minari.load_dataset(f"{env_id}/{name}-v0")
        env = data.recover_environment()
        assert line.startswith(f"{env_id}/{name}-v0: 3 episodes, {data.total_steps:,} steps")
        for episode, seed in zip(
            data.iterate_episodes(),
            (5_000_000_000 + i for i in range(3)),
            strict=True,
        ):
            observation, info = env.reset(seed=seed)
            seen = [observation]
            modes = [info["true_mode"]]
            rewards = []
            for action in episode.actions:
                observation, reward, terminated, _, info = env.step(action)
                seen.append(observation)
                modes.append(info["true_mode"])
                rewards.append(reward)
            assert terminated
            np.testing.assert_array_equal(seen, episode.observations)
            np.testing.assert_array_equal(rewards, episode.rewards)
            np.testing.assert_array_equal(modes, episode.infos["true_mode"])
            np.testing.assert_array_equal(
                np.flatnonzero(episode.terminations),
                [len(episode) - 1],
            )


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        ("", "policies=()"),
        ("--policies ate ate", "policies=('ate', 'ate')"),
        ("--policies fortune", "decider='fortune'"),
        ("--policies ate --episodes 10001", "episodes=10001"),
        ("--policies ate --out /dev/null/x", "out="),
        ("--policies ate --seed -1", "seed=-1"),
        (f"--policies ate --seed {10**29}", f"seed={10**29}"),
        (f"--policies ate --seed {2**63}", "seed="),
    ],
)
def test_what_cannot_be_written_is_refused_in_one_line(root, capsys, flags, message):
    assert main(f"dataset {flags}".split()) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert message in line
    assert list(root.iterdir()) == []


def test_a_data_set_is_not_replaced_and_nothing_half_written_stays(root, capsys):
    command = ["dataset", "--episodes", "2", "--scheme", "S9", "--policies", "ate"]
    assert main(command) == 0
    assert main([*command, "random"]) == 2
    assert "a folder without the data set HybridTrack-v0/ate-v0" in capsys.readouterr().err
    assert [path.name for path in (root / "HybridTrack-v0").iterdir() if path.is_dir()] == [
        "ate-v0"
    ]


def test_an_out_that_cannot_be_made_is_said_without_a_root_of_minari(monkeypatch, capsys):
    monkeypatch.delenv("MINARI_DATASETS_PATH", raising=False)
    assert (
        main(
            [
                "dataset",
                "--policies",
                "ate",
                "--scheme",
                "S9",
                "--episodes",
                "1",
                "--out",
                "/dev/null/x",
            ]
        )
        == 2
    )
    (line,) = capsys.readouterr().err.splitlines()
    assert "out='/dev/null/x' is not allowed" in line
    assert "MINARI_DATASETS_PATH" not in os.environ


def test_a_disk_without_space_is_one_line_and_nothing_stays(root, capsys):
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, before[1]))
    try:
        assert main(["dataset", "--policies", "ate", "--scheme", "S9", "--episodes", "20"]) == 2
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    (line,) = capsys.readouterr().err.splitlines()

    assert "a folder that can be written (File too large)" in line
    assert not root.exists() or not list(root.iterdir())


@pytest.mark.parametrize(
    "flags",
    ["--scheme S9 --episodes 9", "--scheme S400 --episodes 9", "--scheme S9 --episodes 1"],
)
def test_a_data_set_is_not_larger_than_the_space_that_is_asked_for(root, monkeypatch, flags):
    bounds = []
    monkeypatch.setattr(dataset_command, "check_space", lambda folder, size: bounds.append(size))

    assert main(f"dataset --policies random {flags}".split()) == 0
    used = sum(path.stat().st_size for path in root.rglob("*") if path.is_file())
    assert used < bounds[0] < 3 * used + 500_000
