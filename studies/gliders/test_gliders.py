"""Flights of gliders: wind and circles by hindsight, the other decoder, and filters of a flight
in parts.
"""

import numpy as np
import pytest
from made_up_glider import LEFT, RIGHT, fly, made_up_log, write_log
from scipy.linalg import expm

from baselines import parse_igc
from studies.flights.flight import stack_flights
from studies.flights.turns import TurnModel, run_turn_imm, turn_motion
from studies.gliders.circling import air_motion, circles, decode, label_glider
from studies.gliders.logs import (
    HALVES,
    LEFT_OUT,
    SEALED,
    digits,
    glider_flight,
    half_of,
    read_logs,
)


@pytest.fixture(scope="module")
def flown():
    modes, positions, altitudes = fly(5)
    log = parse_igc("log", write_log(positions, altitudes))
    return modes, log, glider_flight("log", "A", log)


def test_wind_and_circles_are_found_by_hindsight(flown):
    modes, _, flight = flown
    (motion,) = air_motion([flight])
    circling = modes > 0

    np.testing.assert_allclose(
        np.median(motion.wind[circling], axis=0),
        [3.0, -1.0],
        atol=0.3,
    )
    assert np.median(motion.speeds) == pytest.approx(10.0, abs=0.4)
    assert np.degrees(np.median(motion.rates[modes == LEFT])) == pytest.approx(18.0, abs=1.0)
    found, doubtful = circles(flight, motion.rates)
    assert (found == modes).mean() > 0.98
    assert not doubtful.any()


def test_a_turn_of_240_degrees_is_neither_a_circle_nor_straight():
    _, positions, altitudes = fly(
        6,
        plan=(
            (0, 60),
            (RIGHT, 13),
            (0, 60),
        ),
    )
    flight = glider_flight(
        "log",
        "A",
        parse_igc("log", write_log(positions, altitudes)),
    )
    (motion,) = air_motion([flight])
    modes, doubtful = circles(flight, motion.rates)

    assert not modes.any()
    assert 10 < doubtful.sum() < 20


def test_labels_are_scored_where_both_rules_agree(flown):
    pytest.importorskip("libigc")
    modes, log, flight = flown
    (motion,) = air_motion([flight])
    decoded = decode(log.records)
    labels = label_glider(flight, motion, decoded)

    assert len(decoded) == len(modes)
    assert labels.scored.mean() > 0.8
    np.testing.assert_array_equal(
        labels.modes[labels.scored],
        labels.own[labels.scored],
    )
    assert (labels.modes == modes)[labels.scored].mean() > 0.98
    assert [mode for *_, mode in labels.pieces] == [0, 1, 0, 2, 0, 2, 1, 0]
    assert not label_glider(flight, motion, np.full(len(modes), -1)).scored.any()


@pytest.mark.parametrize(
    "model",
    [TurnModel(), TurnModel(climb=0.1, climb_level=0.3)],
)
def test_parts_with_a_margin_are_filtered_as_the_whole(flown, model):
    _, _, flight = flown
    whole = stack_flights([flight])
    parts = stack_flights([flight], 100, 90)

    assert parts.times.shape == (280, 6)
    one, other = (
        batch.unstack(run_turn_imm(batch, model).probabilities, [600])[0]
        for batch in (whole, parts)
    )
    np.testing.assert_allclose(one, other, atol=1e-3)


@pytest.mark.parametrize("rate", [0.0, 0.3, -0.2])
def test_a_turn_in_a_wind_is_the_exponential_of_its_equations(rate):
    dt = 1.7
    matrix = np.zeros((6, 6))
    # Positions move with air velocity and wind.
    matrix[0, 1] = matrix[3, 4] = matrix[0, 2] = matrix[3, 5] = 1.0
    matrix[1, 4], matrix[4, 1] = -rate, rate
    model = TurnModel(wind=0.1)
    moved, noise = turn_motion(
        np.array(rate),
        np.array(dt),
        model,
    )

    np.testing.assert_allclose(
        moved,
        expm(matrix * dt),
        atol=1e-12,
    )
    assert noise[2, 2] == noise[5, 5] == pytest.approx(0.17)


def test_logs_are_known_by_their_digests(tmp_path):
    (tmp_path / "inner").mkdir()
    (tmp_path / "inner" / "name.igc").write_bytes(made_up_log(1))
    (found,) = read_logs(tmp_path).items()

    assert found == (digits(made_up_log(1)), made_up_log(1))
    assert [half_of(one) for one in (found[0], HALVES["B"][0], LEFT_OUT[0])] == [SEALED, "B", ""]
    assert [len(set(logs)) for logs in HALVES.values()] == [8, 8]
