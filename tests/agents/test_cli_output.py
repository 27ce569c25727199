"""Output of the command line that cannot be written, and user texts that look like markup."""

import errno
import os
import shutil
import subprocess
import sys

import pytest

from agents.cli import main
from agents.evaluation.registry import SHIPPED, policy_folder
from baselines.rules.decider import ANNOUNCED

COMMAND = [sys.executable, "-m", "agents.cli"]
NO_SPACE = os.strerror(errno.ENOSPC)


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs /dev/full")
@pytest.mark.parametrize("line", ["--help"])
def test_a_full_disk_is_one_line(line):
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [*COMMAND, *line.split()],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
        )
    assert done.returncode == 2
    lines = [text for text in done.stderr.splitlines() if "compiling" not in text]
    assert lines == [f"hybridtrack: [Errno {errno.ENOSPC}] {NO_SPACE}"]


@pytest.mark.parametrize("line", ["evaluate ate --episodes 2 --scheme S5"])
def test_a_reader_that_closes_the_output_ends_the_command_quietly(line):
    end, closed = os.pipe()
    os.close(end)
    done = subprocess.run(
        [*COMMAND, *line.split()],
        stdout=closed,
        stderr=subprocess.PIPE,
        text=True,
    )
    os.close(closed)

    assert done.returncode == 1
    assert [text for text in done.stderr.splitlines() if "compiling" not in text] == []


@pytest.mark.parametrize(
    "error",
    [OSError(errno.ENOSPC, NO_SPACE, "a\nb" * 200), MemoryError("x" * 500)],
)
def test_an_error_of_the_system_is_one_line(error, monkeypatch, capsys):
    def fail(self):
        raise error

    monkeypatch.setattr("agents.commands.evaluate.Evaluate.run", fail)

    assert main(["evaluate"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert len(line) <= 300


@pytest.mark.parametrize(
    "text",
    ["s[/b]", "[b]", ":dog:", "a" * 5000, "\udcff", "a\nb", "\x1b[31m"],
)
@pytest.mark.parametrize(
    "line",
    [
        "{}",
        "evaluate {}",
        "evaluate --out {}/x.json",
        "track {}",
        "play --out x.gif --decider {}",
        "train --recipe {}",
        "train --set {}",
        "evaluate --episodes {}",
        "evaluate --scheme {}",
    ],
)
def test_any_text_of_the_user_gives_one_line(line, text, capsys):
    assert main([text if part == "{}" else part.replace("{}", text) for part in line.split()]) == 2
    (message,) = capsys.readouterr().err.splitlines()
    assert len(message) <= 300


@pytest.mark.parametrize("name", ["s[b]", "a:dog:", "back\\"])
def test_names_of_run_folders_are_printed_as_they_are(name, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copytree(policy_folder(SHIPPED, ANNOUNCED), tmp_path / name)
    few = ["--episodes", "2", "--scheme", "S5"]

    assert main(["evaluate", name, *few]) == 0
    assert name in capsys.readouterr().out
    assert main(["play", "--decider", name, "--scheme", "S5", "--out", "[b]x.png"]) == 0
    printed = capsys.readouterr().out
    assert f"{name}, episode 1" in printed
    assert "[b]x.png" in printed
