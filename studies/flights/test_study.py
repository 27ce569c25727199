import json
from dataclasses import replace

import numpy as np

from agents import run_command
from studies.flights.__main__ import Flights
from studies.flights.figure import COLOURS, flight_figure
from studies.flights.flight import TIERS, Flight
from studies.flights.simulated import simulate_flights
from studies.flights.study import compare_on_flights


def test_the_quick_form_prints_tables_and_writes_pictures(tmp_path, capsys):
    assert not run_command(Flights, "flights", ["--quick", "--out", str(tmp_path)])
    result = json.loads((tmp_path / "flights.json").read_text())

    assert set(result["tiers"]) == {"A", "B", "C", "A-C"}
    figures = result["tiers"]["A-C"]
    assert set(figures) == {"imm", "imm:0.8", "cusum", "beam", "agent", "agent:8"}
    assert min(one["agreement"]["value"] for one in figures.values()) > 0.8
    assert len(result["agreement"]) == 3
    assert (tmp_path / "simulated-B-0.png").stat().st_size > 10_000
    assert "IMM threshold" in capsys.readouterr().out


def test_the_semi_real_form_has_the_deciders_of_the_environment():
    flights, _ = simulate_flights(
        TIERS["B"],
        1,
        900.0,
        np.random.default_rng(0),
    )
    result = compare_on_flights(flights, ("threshold", "beam:0.7"), "semi-real", lambda text: None)

    for name, scores in result.scores.items():
        agreed = scores.of("agreed", 0) / scores.of("scored", 0)
        assert agreed > 0.6, name


def test_stress_flights_are_a_tier_outside_of_the_totals():
    flights, _ = simulate_flights(
        TIERS["B"],
        2,
        900.0,
        np.random.default_rng(0),
    )
    flights = [flights[0], replace(flights[1], tier=TIERS["stress"])]
    result = compare_on_flights(flights, ("imm",), "native", lambda text: None)

    assert result.groups == {"B": [0], "stress": [1]}


def test_bars_show_labels_and_statements_but_no_gap():
    # A gap of five minutes after 21 positions.
    times = np.concatenate([np.arange(21.0), 320.0 + np.arange(21.0)])
    flight = Flight(
        "a",
        TIERS["B"],
        times,
        np.stack([times, times], axis=1),
        np.zeros(42),
    )
    labels = np.repeat(
        [0, 1, 3, 2],
        [10, 11, 1, 20],
    )
    figure = flight_figure(
        flight,
        labels,
        {"beam": np.repeat([0, 2], 21)},
        "a flight",
    )
    bars = [
        (round(bar.get_y() + bar.get_height() / 2), 60.0 * bar.get_x(), 60.0 * bar.get_width())
        for bar in figure.axes[1].patches
    ]

    expected = [(0, 0, 10), (0, 10, 10), (0, 320, 1), (0, 321, 19), (1, 0, 20), (1, 320, 20)]
    np.testing.assert_allclose(bars, expected)
    assert [label.get_text() for label in figure.axes[1].get_yticklabels()] == ["label", "beam"]
    assert len({bar.get_facecolor() for bar in figure.axes[1].patches}) == len(COLOURS) + 1
