"""The league: the same file twice, the tables, and files that were changed."""

import json
from pathlib import Path

import numpy as np
import pytest

from agents import run_command
from hybrid_env import ArgumentError
from studies.league.__main__ import League
from studies.league.families import families_tables, interquartile_mean
from studies.league.protocol import THREE, play, read_entry, scores_of
from studies.league.table import league_tables, shipped_entries


def test_a_decider_gives_the_same_file_twice_which_is_refused_once_it_was_changed(tmp_path):
    first, second = (play("msprt", {"R = 0.1": 8, "unknown, R = 0.1": 8}) for _ in range(2))

    assert json.dumps(first) == json.dumps(second)
    assert "refused" in first["worlds"]["unknown, R = 0.1"]
    estimate = first["worlds"]["R = 0.1"]["metrics"]["reward"]["value"]
    assert estimate == pytest.approx(scores_of(first, "R = 0.1").values.mean(), abs=1e-6)
    path = tmp_path / "forged.json"
    path.write_text(json.dumps(first | {"title": "another"}))
    with pytest.raises(ArgumentError, match="changed by hand"):
        read_entry(path)


def test_the_tables_of_the_entries_are_those_of_the_page():
    page = (Path(__file__).parent / "README.md").read_text(encoding="utf-8")
    lines = page.partition("## Table")[2].partition("## Learned")[0].splitlines()
    published = [line.strip("| ").split(" | ") for line in lines if line.startswith("|")]
    tables = league_tables(shipped_entries())
    rows = [row for part in tables for row in ([*part], *part.to_numpy().tolist())]

    for row in published:
        # The agents of both tasks are in one file.
        row[0] = "shipped" if row[0].startswith("shipped") else row[0]
        assert row in rows or row[0].startswith("---"), row


def test_interquartile_mean_is_that_of_the_middle_half():
    rewards = np.array([[0.0, 10.0], [1.0, 11.0], [2.0, 12.0], [30.0, 13.0]])
    mean = interquartile_mean(rewards)

    assert mean.value == np.sort(rewards, axis=None)[2:6].mean()
    assert mean.low < mean.value < mean.high


def test_the_quick_form_plays_and_trains_and_goes_on_from_what_is_there(tmp_path):
    flags = ["--quick", "--jobs", "1", "--out", str(tmp_path)]
    assert run_command(League, "league", flags) == 0
    assert (tmp_path / "league.png").exists()
    entry = read_entry(tmp_path / "reward.json")
    seeds = entry["worlds"]["R = 0.1"]["seeds"]
    assert scores_of(entry, "R = 0.1").values.mean() == pytest.approx(np.mean(seeds), abs=1e-6)
    middle = interquartile_mean(np.array(seeds)[:, None]).value
    assert f"{middle:.3f} (" in families_tables([entry])[THREE]["R = 0.1"].iloc[0]
    written = {path: path.stat().st_mtime_ns for path in tmp_path.glob("agents/*/league.json")}

    assert run_command(League, "league", [*flags, "--recipes", "reward"]) == 0
    assert {path: path.stat().st_mtime_ns for path in written} == written
