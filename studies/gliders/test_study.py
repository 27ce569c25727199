"""Deciders on made-up logs; sealed logs stay closed."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from made_up_glider import made_up_log

from agents import run_command
from studies.gliders import __main__ as command
from studies.gliders import logs, study
from studies.gliders.circles import Circles
from studies.gliders.report import as_json
from studies.gliders.rules import RULES
from studies.seal import unbroken_seal


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with five logs, of which four are open."""
    pytest.importorskip("libigc")
    contents = [made_up_log(k) for k in range(1, 6)]
    first, second, third, fourth, _ = map(logs.digits, contents)
    halves = {"A": f"{first} {second}", "B": f"{third} {fourth}"}
    monkeypatch.setattr(logs, "HALVES", halves)
    for k, content in enumerate(contents):
        (tmp_path / f"Nobody{k}.igc").write_bytes(content)
    return tmp_path


def test_rules_are_compared_on_open_logs_with_settings_of_the_other_half(folder, monkeypatch):
    grid = (4.0, 6.0, 4.0), (7.0, 10.0, 6.0)
    monkeypatch.setitem(RULES, "xcsoar", replace(RULES["xcsoar"], grid=grid))
    pairs = study.read_halves(folder)
    result = study.compare_on_gliders(pairs, ("imm-climb", "xcsoar"), pairs)
    content = as_json(result)
    figures = content["groups"]["both halves"]["5"]

    assert " ".join(flight.identity for flight, _ in pairs) == " ".join(logs.HALVES.values())
    assert "Nobody" not in json.dumps(content)
    assert figures["imm-climb"]["agreement"]["value"] > 0.9
    assert figures["imm-climb"]["enter"]["value"] < figures["xcsoar"]["enter"]["value"]
    for chosen in result.rules["xcsoar"].chosen.values():
        assert {setting.numbers for setting in chosen.values()} <= set(grid)


def test_sealed_logs_are_opened_by_an_unbroken_seal_only(folder, monkeypatch, capsys):
    assert len(study.read_halves(folder, sealed=True)) == 5
    broken = command.current_seal() | {"programs": {"libigc": "0"}}
    kept = folder / "sealed.json"
    kept.write_text(json.dumps(broken))
    monkeypatch.setattr(command, "SEAL", kept)
    # Nothing is read.
    monkeypatch.setattr(command, "read_halves", None)
    line = ["--source", str(folder), "--deciders", "imm", "--sealed"]
    assert run_command(command.Gliders, "gliders", line) == 2
    assert "libigc differ from sealed.json" in capsys.readouterr().err


def test_the_seal_is_that_of_the_code():
    pytest.importorskip("libigc")
    kept = unbroken_seal(command.SEAL, command.current_seal())

    assert set(kept["settings"]["5"]) == {*RULES, "agent"}


def test_the_quick_form_prints_tables_and_writes_a_picture(tmp_path, capsys):
    line = ["--quick", "--jobs", "1", "--out", str(tmp_path)]
    assert not run_command(command.Gliders, "gliders", line)
    figures = json.loads((tmp_path / "gliders.json").read_text())["groups"]["both halves"]["5"]

    assert figures["agent"]["agreement"]["value"] > 0.8
    assert (tmp_path / "gliders.png").exists()
    assert "XCSoar" in capsys.readouterr().out


def test_circles_of_a_log(tmp_path):
    path = tmp_path / "flight.igc"
    path.write_bytes(made_up_log(7))

    assert not run_command(Circles, "circles", [str(path)])
    rows = pd.read_csv(tmp_path / "flight_circles" / "circles.csv")
    assert rows["side"].tolist() == ["left", "right", "right", "left"]
    columns = ["turns", "wind", "wind_from", "climb"]
    expected = np.array([[turns, 3.16, 288.4, 1.5] for turns in (4.0, 3.0, 4.5, 3.5)])
    assert (np.abs(rows[columns] - expected) < [0.4, 0.5, 8.0, 0.3]).all(axis=None)
    assert rows["stated_after"].between(0.0, 20.0).all()
