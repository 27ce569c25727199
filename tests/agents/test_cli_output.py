"""Output of the command line that cannot be written, and user texts that look like markup."""

import os
import shutil
import subprocess
import sys

import pytest

from agents.cli import main
from agents.evaluation.registry import policy_folder
from baselines.rules.decider import ANNOUNCED

COMMAND = [sys.executable, "-m", "agents.cli"]


def test_a_reader_that_closes_the_output_ends_the_command_quietly():
    end, closed = os.pipe()
    os.close(end)
    done = subprocess.run(
        [*COMMAND, "evaluate", "ate", "--episodes", "2", "--scheme", "S5"],
        stdout=closed,
        stderr=subprocess.PIPE,
        text=True,
    )
    os.close(closed)

    assert done.returncode == 1
    assert [text for text in done.stderr.splitlines() if "compiling" not in text] == []


@pytest.mark.parametrize("text", ["s[/b]", "a" * 5000, "\udcff"])
@pytest.mark.parametrize(
    "line",
    [
        "{}",
        "evaluate {}",
        "train --recipe {}",
        "evaluate --episodes {}",
    ],
)
def test_any_text_of_the_user_gives_one_line(line, text, capsys):
    assert main([text if part == "{}" else part.replace("{}", text) for part in line.split()]) == 2
    (message,) = capsys.readouterr().err.splitlines()
    assert len(message) <= 300


def test_names_of_run_folders_are_printed_as_they_are(tmp_path, capsys, monkeypatch):
    name = "s[b]:dog:back\\"
    monkeypatch.chdir(tmp_path)
    shutil.copytree(policy_folder("shipped", ANNOUNCED), tmp_path / name)
    few = ["--episodes", "2", "--scheme", "S5"]

    assert main(["evaluate", name, *few]) == 0
    assert name in capsys.readouterr().out
    assert main(["play", "--decider", name, "--scheme", "S5", "--out", "[b]x.png"]) == 0
    printed = capsys.readouterr().out
    assert f"{name}, episode 1" in printed
    assert "[b]x.png" in printed
