"""The command line: every command runs, prints and writes its results."""

import json
import shlex

import pytest

from agents.cli import main
from agents.evaluation import selection


def unwrapped(capsys):
    """The output as one line; long paths may be wrapped anywhere."""
    return " ".join(capsys.readouterr().out.split())


def test_a_run_is_trained_resumed_and_evaluated(capsys, tmp_path):
    run = str(tmp_path / "run")
    small = ["n_envs=8", "n_steps=32", "batch_size=64", "policy_kwargs.net_arch=[8]"]

    assert main(["train", "--out", run, "--steps", "256", "--set", *small]) == 0
    assert main(["train", "--resume", run, "--steps", "512"]) == 0
    assert "512 steps" in unwrapped(capsys)
    assert main(["evaluate", run, "--episodes", "3", "--scheme", "S10 S10"]) == 0
    assert main(["train", "--out", run]) == 2
    assert main(["train", "--resume", run, "--set", "n_envs=8"]) == 2
    assert main(["evaluate", run, "--radii", "1", "2"]) == 2


def test_evaluate_shows_degradation_in_shifted_environments(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(selection, "MOST_THRESHOLDS", 3)
    out = tmp_path / "shifts.json"
    line = f"evaluate fixed msprt --shifted --episodes 10 --scheme random\\ 2x20-30 --out {out}"

    assert main(shlex.split(line)) == 0
    printed = capsys.readouterr().out
    for words in ("nominal", "5 % outliers", "twice the radii", "half the length", "MSPRT"):
        assert words in printed
    data = json.loads(out.read_text())
    rows = data["results"]
    assert len(rows) >= 2 * 20
    assert all(row["low"] <= row["reward"] <= row["high"] for row in rows)
    assert all(row["nominal_low"] <= row["nominal_reward"] <= row["nominal_high"] for row in rows)
    by_world = {row["world"]: row for row in rows if row["decider"] == "fixed time"}
    assert by_world["half the length"]["ticks"] <= 15
    msprt = {row["world"]: row for row in rows if row["decider"] == "MSPRT"}
    for row in data["differences"]:
        difference = by_world[row["world"]]["reward"] - msprt[row["world"]]["reward"]
        assert row["difference"] == pytest.approx(difference)
        assert row["low"] <= row["difference"] <= row["high"]
