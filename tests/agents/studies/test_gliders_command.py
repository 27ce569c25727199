"""`compare --gliders` and `track` of a log, on made-up flights; sealed logs stay closed."""

import csv
import io
import json
import tarfile

import numpy as np
import pytest
from made_up_glider import made_up_log

from agents.cli import main
from agents.evaluation import gliders as evaluated
from agents.interface.parallel import Workers
from agents.learned.glider_decider import GliderAgent
from agents.studies import gliders_study as study
from baselines.recordings.flights import gliders
from baselines.rules.circling import GliderImm, XcsoarRule

OPEN, CLOSED = {"A": (1, 2), "B": (3, 4)}, 5


@pytest.fixture
def archive(tmp_path, monkeypatch):
    """An archive of five logs, of which four are open; small grids."""
    halves = {
        half: tuple(gliders.digits(made_up_log(k)) for k in seeds) for half, seeds in OPEN.items()
    }
    for half, logs in halves.items():
        monkeypatch.setitem(gliders.HALVES, half, logs)
    monkeypatch.setattr(GliderImm, "models", GliderImm.models[:1])
    monkeypatch.setattr(GliderImm, "grid", ((0.7, 0.7), (0.95, 0.9)))
    monkeypatch.setattr(
        XcsoarRule,
        "grid",
        ((4.0, 6.0, 4.0), (7.0, 10.0, 6.0)),
    )
    monkeypatch.setattr(GliderAgent, "grid", ((0.0, 0.0), (4.0, 0.0)))
    monkeypatch.setattr(study, "SIMULATED", 3)
    path = tmp_path / "logs.tgz"
    with tarfile.open(path, "w:gz") as file:
        for k in (*OPEN["A"], *OPEN["B"], CLOSED):
            content = made_up_log(k)
            entry = tarfile.TarInfo(f"package/test/Nobody{k}.igc")
            entry.size = len(content)
            file.addfile(entry, io.BytesIO(content))
    return path


def compare(archive, *flags):
    pytest.importorskip("libigc")
    out = archive.parent / "out"
    line = ["compare", "--gliders", "--source", str(archive), "--jobs", "1", "--out", str(out)]
    line += ["--deciders", "imm", "xcsoar", "agent"]
    code = main([*line, *flags])
    return code, out


def test_rules_are_compared_on_open_logs_only(archive, monkeypatch, capsys):
    parsed = []
    plain = evaluated.parse_igc
    monkeypatch.setattr(
        evaluated,
        "parse_igc",
        lambda name, content: parsed.append(name) or plain(name, content),
    )
    code, out = compare(archive)
    printed = capsys.readouterr().out

    assert not code
    assert "4 flights of gliders" in printed
    assert "Nobody" not in printed
    assert set(parsed) == {gliders.digits(made_up_log(k)) for k in range(1, CLOSED)}
    result = json.loads((out / "gliders.json").read_text())
    figures = result["groups"]["both halves"]["5"]
    assert figures["imm"]["agreement"]["value"] > 0.9 > 0.2 > figures["imm"]["misses_in"]["value"]
    assert figures["imm"]["enter"]["value"] < figures["xcsoar"]["enter"]["value"]
    assert figures["xcsoar"]["agreement_less_first"]["value"] < 0.0
    assert 0.8 < figures["agent"]["agreement"]["value"] < 1.0
    assert 0.7 < figures["imm"]["simulated"]["agreement"]["value"] < 1.0
    assert "straight: airspeed, m/s" in printed
    assert result["gap"]["circling: turn rate, deg/s"][0][1] == pytest.approx(18.0, abs=1.0)
    assert "Nobody" not in json.dumps(result)
    assert (out / "gliders.png").stat().st_size > 10_000


def test_settings_are_those_of_the_other_half(archive):
    pytest.importorskip("libigc")
    result = study.compare_on_gliders(archive, ("xcsoar",), Workers(), lambda text: None)
    flights, labels = result.flights, result.labels
    settings = evaluated.all_settings("xcsoar")
    swept = evaluated.score_settings(
        flights,
        labels,
        evaluated.glider_statements(flights, settings),
    )
    for level, by_name in result.chosen.items():
        for half, rows in (
            ("A", [2, 3]),
            ("B", [0, 1]),
        ):
            assert by_name["xcsoar"][half] == settings[study.select(swept.some(rows), level)]
            assert by_name["xcsoar"][half] in settings


def test_sealed_logs_are_opened_by_an_unbroken_seal_only(archive, monkeypatch, tmp_path, capsys):
    code, out = compare(archive)
    seal = json.loads((out / "gliders.json").read_text())["seal"]
    kept = tmp_path / "sealed.json"
    monkeypatch.setattr(study, "SEAL", kept)
    kept.write_text(json.dumps(seal))
    code, out = compare(archive, "--sealed")

    assert not code
    assert "1 flights of gliders, sealed" in capsys.readouterr().out
    result = json.loads((out / "gliders.json").read_text())
    assert set(result["groups"]) == {"both halves", "sealed"}
    assert result["seal"] == seal
    seal["code"]["labels"] = "0" * 64
    kept.write_text(json.dumps(seal))
    code, _ = compare(archive, "--sealed")
    assert code == 2
    assert "labels differ from sealed.json" in capsys.readouterr().err


def test_the_seal_of_the_package_is_that_of_its_code():
    pytest.importorskip("libigc")
    seal = json.loads(study.SEAL.read_text())

    assert {part: seal[part] for part in ("code", "weights")} == study.current_seal()
    assert set(seal["settings"]["5"]) == set(study.default_names())


def test_a_log_is_tracked_by_its_circles(tmp_path, capsys):
    path = tmp_path / "flight.igc"
    path.write_bytes(made_up_log(7))

    assert not main(["track", str(path)])
    assert "4 times circling" in capsys.readouterr().out
    with (tmp_path / "flight_track" / "circles.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["side"] for row in rows] == ["left", "right", "right", "left"]
    for row, seconds in zip(rows, (80, 60, 90, 70), strict=True):
        assert float(row["seconds"]) == pytest.approx(seconds, abs=8)
        assert float(row["turns"]) == pytest.approx(seconds * 18.0 / 360.0, abs=0.4)
        assert float(row["wind"]) == pytest.approx(np.hypot(3.0, 1.0), abs=0.5)
        assert float(row["wind_from"]) == pytest.approx(288.4, abs=8)
        assert float(row["climb"]) == pytest.approx(1.5, abs=0.3)
        assert 0.0 < float(row["stated_after"]) < 20.0
    assert (tmp_path / "flight_track" / "track.png").stat().st_size > 10_000
    assert not main(
        [
            "track",
            str(path),
            "--decider",
            "threshold",
            "--out",
            str(tmp_path / "any"),
            "--no-picture",
        ]
    )
    assert (tmp_path / "any" / "modes.csv").is_file()


@pytest.mark.parametrize(
    ("edit", "turns", "said"),
    [
        ("ahead", 4.0, "does not fit: 1"),
        ("back", 4.0, "set back"),
    ],
)
def test_a_wrong_clock_is_said_and_ends_a_circle(edit, turns, said, tmp_path, capsys):
    lines = made_up_log(7).split(b"\r\n")
    first = next(k for k, line in enumerate(lines) if line.startswith(b"B"))
    wrong = range(first + 130, first + 131) if edit == "ahead" else range(first + 130, first + 600)
    # In the first circle.
    for k in wrong:
        lines[k] = b"B%02d" % (int(lines[k][1:3]) + (3 if edit == "ahead" else -2)) + lines[k][3:]
    path = tmp_path / "flight.igc"
    path.write_bytes(b"\r\n".join(lines))

    assert not main(["track", str(path), "--no-picture"])
    printed = capsys.readouterr().out
    assert said in printed
    assert ("steps of the clock, which end a circle: 1" in printed) == (edit == "back")
    with (tmp_path / "flight_track" / "circles.csv").open() as file:
        rows = list(csv.DictReader(file))
    left = [float(row["turns"]) for row in rows[: 1 if edit == "ahead" else 2]]
    assert [row["side"] for row in rows] == ["left"] * len(left) + ["right", "right", "left"]
    assert sum(left) == pytest.approx(turns, abs=0.6)
    assert max(float(row["seconds"]) for row in rows) < 100
