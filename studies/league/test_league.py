"""The league: the same file twice, the tables, and files that were changed."""

import json
import re
from pathlib import Path

import pytest

from agents import run_command
from hybrid_env import ArgumentError
from studies.league.__main__ import League
from studies.league.protocol import play, read_entry, scores_of
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


def test_the_quick_form_plays_and_writes_files_that_are_read_again(tmp_path, capsys):
    assert run_command(League, "league", ["--quick", "--jobs", "1", "--out", str(tmp_path)]) == 0
    assert (tmp_path / "league.png").exists()
    assert read_entry(tmp_path / "MSPRT.json")["title"] == "MSPRT"
    [row] = re.findall(r"^\| MSPRT \|.*", (tmp_path / "league.md").read_text(), re.MULTILINE)

    shown = ["--quick", "--table", str(tmp_path / "MSPRT.json"), "--out", str(tmp_path / "again")]
    assert run_command(League, "league", ["threshold", "--jobs", "1", *shown]) == 0
    assert row in (tmp_path / "again/league.md").read_text()
