"""Deciders that are not told of a departure, beside rules that are."""

import json

import pytest
from PIL import Image

from agents.cli import main
from agents.studies import departures
from agents.studies.departures import ANNOUNCED, ROADS, UNKNOWN, calls
from baselines.rules import seeds


@pytest.fixture(autouse=True)
def quick_rules(monkeypatch):
    monkeypatch.setattr(departures, "TOLD", {ANNOUNCED: ("msprt",), UNKNOWN: ("threshold",)})
    monkeypatch.setattr(
        departures,
        "DECIDERS",
        {ANNOUNCED: ("msprt", "ate"), UNKNOWN: ("threshold",)},
    )
    monkeypatch.setattr(seeds, "SELECTION_EPISODES", 20)


def test_the_command_writes_its_files(tmp_path, capsys, monkeypatch):
    roads = {name: (task, (levels[0], levels[-1])) for name, (task, levels) in ROADS.items()}
    monkeypatch.setattr(departures, "ROADS", roads)

    assert len(calls((), 10, 0)) == 8
    assert (
        main(["limits", "--departures", "--episodes", "10", "--jobs", "1", "--out", str(tmp_path)])
        == 0
    )
    assert "Rhythm: durations" in capsys.readouterr().out
    found = json.loads((tmp_path / "departures.json").read_text())
    assert len(found) == 3 * 2 * 3 + 2 * 2
    assert (tmp_path / "departures.md").read_text().count("|---") == 3 * 4 + 3
    with Image.open(tmp_path / "departures.png") as image:
        assert image.width > 1000
