"""The command line: every command runs and writes its results."""

import errno

from tensorboard.summary.writer.record_writer import RecordWriter

from agents.cli import main
from agents.training.algorithm import Algorithm


def train(run):
    """Train a small agent in a folder."""
    small = "n_envs=8", "n_steps=32", "batch_size=64", "policy_kwargs.net_arch=[8]"
    return main(["train", "--out", run, "--steps", "256", "--set", *small])


def test_a_run_is_trained_resumed_and_evaluated(tmp_path):
    run = str(tmp_path / "run")

    assert train(run) == 0
    assert main(["train", "--resume", run, "--steps", "512"]) == 0
    assert main(["evaluate", run, "--episodes", "3", "--scheme", "S10 S10"]) == 0
    assert main(["train", "--out", run]) == 2
    assert main(["train", "--resume", run, "--set", "n_envs=8"]) == 2


def lines_of(capsys):
    """What a command says, without progress and what is compiled the first time."""
    others = ("0:00:", "HybridTrack: compiling")
    return [line for line in capsys.readouterr().err.splitlines() if not line.startswith(others)]


def test_an_interrupted_training_says_how_it_continues(tmp_path, monkeypatch, capsys):
    def interrupt(self):
        raise KeyboardInterrupt

    monkeypatch.setattr(Algorithm, "between_updates", interrupt)

    assert train(str(tmp_path / "run")) == 130
    (line,) = lines_of(capsys)
    assert line.startswith("hybridtrack: interrupted: hybridtrack train --resume ")


def test_a_full_disk_ends_a_training_with_one_line(tmp_path, monkeypatch, capsys):
    """TensorBoard writes in a thread, whose traceback would stand beside the line."""

    def fill_disk(self, data):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(RecordWriter, "write", fill_disk)

    assert train(str(tmp_path / "run")) == 2
    (line,) = lines_of(capsys)
    assert "expected a path that can be written (No space left on device)" in line
    assert not (tmp_path / "run" / "checkpoint.pt").exists()
