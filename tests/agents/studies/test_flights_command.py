import gzip
import json

import numpy as np
import pytest

from agents.evaluation.flights import FlightTask
from agents.studies.compare_command import Compare
from agents.studies.flights_study import compare_on_flights, without_stress
from baselines.recordings.flights import flight as flight_module
from baselines.recordings.flights.flight import TIERS
from baselines.recordings.flights.simulated import simulate_flights

BOTH = ("two:abc120:0", "two:abc121:0")


@pytest.fixture
def source(tmp_path):
    flights, _ = simulate_flights(TIERS["B"], 2, 900.0, np.random.default_rng(0))
    rows = [
        {
            "timestamp": int(1000 * (1.6e9 + time)),
            "icao24": f"abc12{k}",
            "latitude": y / 111_320.0,
            "longitude": x / 111_320.0,
            "track": None,
        }
        for k, flight in enumerate(flights)
        for time, (x, y) in zip(flight.times, flight.positions, strict=True)
    ]
    folder = tmp_path / "samples"
    folder.mkdir()
    with gzip.open(folder / "two.json.gz", "wt") as file:
        json.dump(rows, file)
    return folder


def test_flights_are_compared(tmp_path, source, capsys):
    out = tmp_path / "out"
    Compare(flights=BOTH, source=source, out=out).run()
    result = json.loads((out / "flights.json").read_text())

    assert set(result["tiers"]["B"]) == {"imm", "imm:0.8", "cusum", "beam", "agent", "agent:8"}
    assert result["tiers"]["B"]["imm"]["agreement"] > 0.8
    assert len(result["flights"]) == 2
    assert (out / "two-abc120-0.png").stat().st_size > 10_000
    assert "IMM threshold" in capsys.readouterr().out


def test_the_semi_real_form_has_the_deciders_of_the_environment(tmp_path, source, capsys):
    out = tmp_path / "out"
    names = ("threshold", "beam:0.7", "glr", "shipped")
    Compare(
        flights=("two:abc120:0",),
        source=source,
        form="semi-real",
        deciders=names,
        out=out,
    ).run()
    result = json.loads((out / "flights.json").read_text())

    assert result["form"] == "semi-real"
    assert result["labels"] == []
    figures = result["tiers"]["B"]
    assert set(figures) == set(names)
    for name in ("threshold", "shipped"):
        assert figures[name]["agreement"] > 0.6
        assert figures[name]["twins"]["agreement"] > 0.6
    assert "beam 0.7" in capsys.readouterr().out


def test_stress_flights_are_a_tier_outside_of_the_totals(tmp_path, source, monkeypatch):
    monkeypatch.setattr(flight_module, "STRESSING", frozenset({"two:abc121:0"}))
    task = FlightTask(source, BOTH, tuple(TIERS), "native")
    result = compare_on_flights(task, {"imm": "IMM"}, lambda text: None)

    assert result.groups == {"B": [0], "stress": [1]}
    assert without_stress(result.flights) == [0]
    turns = sum(mode != 0 for *_, mode in result.labels[0].pieces)
    assert result.sensitivity[0]["turns"] == turns
    assert {field: getattr(TIERS["stress"], field) for field in ("across", "timing")} == {
        field: getattr(TIERS["B"], field) for field in ("across", "timing")
    }
