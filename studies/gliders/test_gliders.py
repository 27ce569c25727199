"""Flights of gliders: wind and circles by hindsight, the other decoder, filters of a flight in
parts, a rule against a literal loop, a short training, and deciders on made-up logs; sealed logs
stay closed.
"""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from made_up_glider import LEFT, fly, made_up_log, write_log
from scipy.linalg import expm

from agents import run_command, train
from baselines import Scores, parse_igc
from studies.flights.flight import stack_flights
from studies.flights.turns import TurnModel, run_turn_imm, turn_motion
from studies.gliders import __main__ as command
from studies.gliders import logs, study
from studies.gliders.circles import Circles
from studies.gliders.circling import air_motion, circles, decode
from studies.gliders.hindsight import HINDSIGHT
from studies.gliders.report import report
from studies.gliders.rules import MODELS, RULES
from studies.gliders.simulated import decode_fast, simulate_glider, turns_fast
from studies.gliders.study import Setting, glider_statements
from studies.gliders.training import Gliders
from studies.seal import unbroken_seal


def read(positions, altitudes):
    log = parse_igc("log", write_log(positions, altitudes))
    return log, logs.glider_flight("log", "A", log)


def test_wind_and_circles_are_found_by_hindsight():
    modes, *track = fly(5)
    _, flight = read(*track)
    (motion,) = air_motion([flight])
    hindsight, doubtful = circles(flight, motion.rates)

    wind = np.median(motion.wind[modes > 0], axis=0)
    np.testing.assert_allclose(wind, [3.0, -1.0], atol=0.3)
    assert np.median(motion.speeds) == pytest.approx(10.0, abs=0.4)
    assert np.degrees(np.median(motion.rates[modes == LEFT])) == pytest.approx(18.0, abs=1.0)
    assert (hindsight == modes).mean() > 0.98
    assert not doubtful.any()


def test_parts_with_a_margin_are_filtered_as_the_whole():
    _, flight = read(*fly(5)[1:])
    model = TurnModel(climb=0.1, climb_level=0.3)
    whole, parts = (
        batch.unstack(run_turn_imm(batch, model).probabilities)[0]
        for batch in (stack_flights([flight]), stack_flights([flight], 100, 90))
    )
    np.testing.assert_allclose(whole, parts, atol=1e-3)


@pytest.mark.parametrize("rate", [0.0, -0.2])
def test_a_turn_in_a_wind_is_the_exponential_of_its_equations(rate):
    # Positions move with air velocity and wind.
    matrix = np.kron(np.eye(2), [[0.0, 1.0, 1.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    matrix[1, 4], matrix[4, 1] = -rate, rate
    moved, noise = turn_motion(np.array(rate), np.array(1.7), TurnModel(wind=0.1))

    np.testing.assert_allclose(moved, expm(1.7 * matrix), atol=1e-12)
    assert noise[2, 2] == noise[5, 5] == pytest.approx(0.17)


def test_rule_b_is_that_of_libigc():
    """Its decoder reads the positions as a log."""
    pytest.importorskip("libigc")
    flight = simulate_glider(1500.0, np.random.default_rng(3))
    times = np.arange(flight.times[-1])
    east, north, height = (
        np.interp(times, flight.times, values)
        for values in (*flight.positions.T, flight.altitudes + 1500.0)
    )
    log, copy = read(np.column_stack([east, north]), height)
    decoded = decode(log.records)
    states = decode_fast(turns_fast(copy)[:, None])[:, 0]

    assert (states == decoded)[decoded >= 0].mean() > 0.98


def literal_xcsoar(turns, rate, enter, leave):
    smooth = 0.0
    since = None
    mode = 0
    for k, turned in enumerate(turns):
        if k:
            smooth = 0.7 * smooth + 0.3 * max(min(np.degrees(turned), 50.0), -50.0)
        turning = abs(smooth) >= rate
        if turning == (mode > 0):
            since = None
        else:
            since = k if since is None else since
            if k - since > (leave if mode else enter):
                mode, since = (0 if mode else 1), None
        if mode and turning:
            mode = 1 if smooth > 0.0 else 2
        yield mode


def test_the_rule_of_xcsoar_at_several_settings_is_a_literal_loop():
    batch = stack_flights([read(*fly(1, noise=1.5)[1:])[1]])
    settings = [(4.0, 15.0, 10.0), (8.0, 4.0, 0.0), (6.0, 10.0, 3.0)]
    moves = np.diff(batch.positions[:, 0], axis=0)
    change = np.diff(np.arctan2(moves[:, 1], moves[:, 0]))
    turns = np.append([0.0, 0.0], (change + np.pi) % (2.0 * np.pi) - np.pi)

    stated = RULES["xcsoar"].state(batch, run_turn_imm(batch, MODELS[0]), settings)[:, 0].T
    np.testing.assert_array_equal(
        stated, [list(literal_xcsoar(turns, *setting)) for setting in settings]
    )


@pytest.mark.parametrize("name", HINDSIGHT)
def test_rules_that_see_the_whole_flight_find_circles_and_their_sides(name):
    modes, *track = fly(5)
    _, flight = read(*track)
    rule = HINDSIGHT[name]
    batch = stack_flights([flight])
    stated = rule.statements(batch, run_turn_imm(batch, MODELS[0]), rule.grid, rule.models[0])

    assert (stated[:, 0, 0] == modes).mean() > 0.95


def test_a_short_training_gives_an_agent_with_several_settings(tmp_path, monkeypatch):
    monkeypatch.setattr(Gliders, "curve_flights", (2,))
    small = ("flights=[4]", "rows=300", "n_steps=100", "hidden=6", "learning_rate=0.02")
    folder = tmp_path / "mine"
    train("studies/gliders/gliders.yml", out=folder, steps=10_000, changes=small)
    flights = [simulate_glider(1500.0, np.random.default_rng(3))]
    settings = [Setting(str(folder), 0, (margin, margin)) for margin in (0.0, 3.0)]
    (stated,) = glider_statements(flights, settings)
    (alone,) = glider_statements(flights, settings[1:])

    np.testing.assert_array_equal(alone[:, 0], stated[:, 1])
    many, few = np.count_nonzero(np.diff(stated, axis=0), axis=0)
    assert few < many


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
    monkeypatch.setitem(study.DECIDERS, "xcsoar", replace(RULES["xcsoar"], grid=grid))
    pairs = study.read_halves(folder)
    results = {name: study.compare_rule(name, pairs, pairs, {}) for name in ("imm-climb", "xcsoar")}
    text, content = report(pairs, pairs, results)
    ours, theirs = content["groups"]["both halves"]["5"].values()

    assert " ".join(flight.identity for flight, _ in pairs) == " ".join(logs.HALVES.values())
    assert "Nobody" not in text
    assert ours["agreement"].value > 0.9
    assert theirs["enter_less_first"].value == theirs["enter"].value - ours["enter"].value > 0.0
    for chosen in results["xcsoar"].chosen.values():
        assert {setting.numbers for setting in chosen.values()} <= set(grid)


def test_a_setting_is_the_best_by_agreement_or_by_delays_with_few_false_changes():
    """The fourth of five settings states too much, and the last one states no circle."""
    table = {
        "scored": [3600.0] * 5,
        "agreed": [3400.0, 3450.0, 3300.0, 3590.0, 1800.0],
        "switches": [20.0] * 5,
        "missed": [0.0, 0.0, 4.0, 0.0, 20.0],
        "delay": [140.0, 150.0, 80.0, 20.0, 0.0],
        "ends": [10.0] * 5,
        "missed_ends": [0.0, 0.0, 2.0, 0.0, 10.0],
        "delay_of_ends": [40.0, 70.0, 40.0, 10.0, 0.0],
        "false": [5.0, 5.0, 2.0, 9.0, 0.0],
    }
    scores = Scores("", "", tuple(range(5)), tuple(table), np.array([list(table.values())]))

    assert study.select(scores, [0], 5.0) == 1
    # Delays of 10 + 4, 8 + 7 and 5 + 5 s.
    assert study.select(scores, [0], 5.0, for_delays=True) == 2
    assert study.select(scores, [0], 9.0, for_delays=True) == 3


def test_sealed_logs_are_opened_by_an_unbroken_seal_only(folder, monkeypatch, capsys):
    kept = unbroken_seal(command.SEAL)
    assert set(kept["settings"]["5"]) == {*RULES, "agent"}
    assert len(study.read_halves(folder, sealed=True)) == 5
    file = folder / "sealed.json"
    file.write_text(json.dumps(kept | {"programs": {"libigc": "0"}}))
    monkeypatch.setattr(command, "SEAL", file)
    # Nothing is read.
    monkeypatch.setattr(command, "read_halves", None)
    line = ["imm", "--source", str(folder), "--sealed"]
    assert run_command(command.Gliders, "gliders", line) == 2
    assert "libigc differ from sealed.json" in capsys.readouterr().err


def test_the_quick_form_prints_tables_and_writes_a_picture(tmp_path, capsys):
    line = ["--quick", "--jobs", "1", "--out", str(tmp_path)]
    assert not run_command(command.Gliders, "gliders", line)
    statistics = json.loads((tmp_path / "gliders.json").read_text())["groups"]["both halves"]["5"]

    assert statistics["agent"]["agreement"]["value"] > 0.8
    assert (tmp_path / "gliders.png").exists()
    assert "xcsoar-default" in capsys.readouterr().out


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
