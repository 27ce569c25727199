"""Deciders on made-up logs; sealed logs stay closed."""

import json

import numpy as np
import pandas as pd
import pytest
from made_up_glider import made_up_log

from agents import run_command
from studies.gliders import logs, study
from studies.gliders.__main__ import Gliders
from studies.gliders.agent import GliderAgent
from studies.gliders.circles import Circles
from studies.gliders.rules import GliderImm, XcsoarRule

OPEN, CLOSED = {"A": (1, 2), "B": (3, 4)}, 5


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with five logs, of which four are open; small grids."""
    pytest.importorskip("libigc")
    for half, seeds in OPEN.items():
        monkeypatch.setitem(
            logs.HALVES,
            half,
            tuple(logs.digits(made_up_log(k)) for k in seeds),
        )
    monkeypatch.setattr(GliderImm, "models", GliderImm.models[:1])
    monkeypatch.setattr(
        GliderImm,
        "grid",
        ((0.7, 0.7), (0.95, 0.9)),
    )
    monkeypatch.setattr(
        XcsoarRule,
        "grid",
        ((4.0, 6.0, 4.0), (7.0, 10.0, 6.0)),
    )
    monkeypatch.setattr(
        GliderAgent,
        "grid",
        ((0.0, 0.0), (4.0, 0.0)),
    )
    for k in (*OPEN["A"], *OPEN["B"], CLOSED):
        (tmp_path / f"Nobody{k}.igc").write_bytes(made_up_log(k))
    return tmp_path


@pytest.fixture
def parsed(monkeypatch):
    """Names of the logs that are parsed."""
    names = []
    plain = study.parse_igc
    monkeypatch.setattr(
        study,
        "parse_igc",
        lambda name, content: names.append(name) or plain(name, content),
    )
    return names


def test_rules_are_compared_on_open_logs_only(folder, parsed):
    flights, labels = study.read_halves(folder)
    copies = study.simulated(2, 1200.0, 0)
    names = ("imm", "xcsoar", "agent")
    result = study.compare_on_gliders(flights, labels, names, copies)
    content = study.as_json(result)

    assert set(parsed) == {logs.digits(made_up_log(k)) for k in range(1, CLOSED)}
    assert "Nobody" not in json.dumps(content)
    figures = content["groups"]["both halves"]["5"]
    assert figures["imm"]["agreement"]["value"] > 0.9 > 0.2 > figures["imm"]["misses_in"]["value"]
    assert figures["imm"]["enter"]["value"] < figures["xcsoar"]["enter"]["value"]
    assert figures["xcsoar"]["agreement_less_first"]["value"] < 0.0
    assert 0.8 < figures["agent"]["agreement"]["value"] < 1.0
    assert content["gap"]["circling: turn rate, deg/s"][0][1] == pytest.approx(18.0, abs=1.0)
    # Settings are those of the other half.
    settings = study.all_settings("xcsoar")
    stated = study.glider_statements(flights, settings)
    swept = study.score_settings(flights, labels, stated)
    for level, chosen in result.chosen.items():
        for half, rows in (
            ("A", [2, 3]),
            ("B", [0, 1]),
        ):
            assert chosen["xcsoar"][half] == settings[study.select(swept.some(rows), level)]


def test_sealed_logs_are_opened_by_an_unbroken_seal_only(folder, parsed, monkeypatch, capsys):
    kept = folder / "sealed.json"
    monkeypatch.setattr(study, "SEAL", kept)
    setting = ["imm", 0, [0.7, 0.7]]
    settings = {f"{level:g}": {"imm": setting} for level in study.LEVELS}
    kept.write_text(json.dumps(study.current_seal() | {"settings": settings}))
    flights, labels = study.read_halves(folder, sealed=True)
    seal = study.unbroken_seal(("imm",))
    copies = study.simulated(2, 1200.0, 0)
    result = study.compare_on_gliders(
        flights,
        labels,
        ("imm",),
        copies,
        seal=seal,
    )

    assert set(study.as_json(result)["groups"]) == {"both halves", "sealed"}
    assert list(result.chosen[5.0]["imm"]["sealed"]) == ["imm", 0, (0.7, 0.7)]
    seal["code"]["labels"] = "0" * 64
    kept.write_text(json.dumps(seal))
    parsed.clear()
    line = ["--source", str(folder), "--deciders", "imm", "--sealed"]
    assert run_command(Gliders, "gliders", line) == 2
    assert "labels differ from sealed.json" in capsys.readouterr().err
    assert not parsed


def test_the_seal_is_that_of_the_code():
    pytest.importorskip("libigc")
    names = study.candidate("agent").title, *study.RULES

    assert set(study.unbroken_seal(names)["settings"]["5"]) == set(names)


def test_the_quick_form_prints_tables_and_writes_a_picture(tmp_path, capsys):
    pytest.importorskip("libigc")
    line = ["--quick", "--jobs", "1", "--out", str(tmp_path)]
    assert not run_command(Gliders, "gliders", line)
    figures = json.loads((tmp_path / "gliders.json").read_text())["groups"]["both halves"]["5"]

    assert figures["agent"]["agreement"]["value"] > 0.8
    assert (tmp_path / "gliders.png").stat().st_size > 10_000
    assert "XCSoar" in capsys.readouterr().out


def test_circles_of_a_log(tmp_path):
    path = tmp_path / "flight.igc"
    path.write_bytes(made_up_log(7))

    assert not run_command(Circles, "circles", [str(path)])
    rows = pd.read_csv(tmp_path / "flight_circles" / "circles.csv")
    seconds = np.array([80, 60, 90, 70])
    assert rows["side"].tolist() == ["left", "right", "right", "left"]
    np.testing.assert_allclose(
        rows["seconds"],
        seconds,
        atol=8,
    )
    np.testing.assert_allclose(
        rows["turns"],
        seconds * 18.0 / 360.0,
        atol=0.4,
    )
    np.testing.assert_allclose(
        rows["wind"],
        np.hypot(3.0, 1.0),
        atol=0.5,
    )
    np.testing.assert_allclose(
        rows["wind_from"],
        288.4,
        atol=8,
    )
    np.testing.assert_allclose(
        rows["climb"],
        1.5,
        atol=0.3,
    )
    assert rows["stated_after"].between(0.0, 20.0).all()
    assert (tmp_path / "flight_circles" / "track.png").stat().st_size > 10_000


def test_a_clock_that_is_set_back_ends_a_circle(tmp_path, capsys):
    lines = made_up_log(7).split(b"\r\n")
    first = next(k for k, line in enumerate(lines) if line.startswith(b"B"))
    # In the first circle.
    for k in range(first + 130, first + 600):
        lines[k] = b"B%02d" % (int(lines[k][1:3]) - 2) + lines[k][3:]
    path = tmp_path / "flight.igc"
    path.write_bytes(b"\r\n".join(lines))

    assert not run_command(Circles, "circles", [str(path)])
    assert "set back" in capsys.readouterr().out
    rows = pd.read_csv(tmp_path / "flight_circles" / "circles.csv")
    assert rows["side"].tolist() == ["left", "left", "right", "right", "left"]
    assert rows["turns"][:2].sum() == pytest.approx(4.0, abs=0.6)
