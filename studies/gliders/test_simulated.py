"""Simulated flights of gliders, and their labels."""

import numpy as np
import pytest
from made_up_glider import write_log

from baselines import parse_igc
from studies.gliders.circling import air_motion, decode, label_glider
from studies.gliders.logs import glider_flight
from studies.gliders.simulated import (
    label_gliders,
    one_after_the_other,
    simulate_glider,
)


@pytest.fixture(scope="module")
def flights():
    generator = np.random.default_rng(2)
    return [simulate_glider(1800.0, generator) for _ in range(20)]


def test_turns_rise_and_fall_one_after_the_other():
    turns = one_after_the_other(
        *np.array([[2.0, 0.0], [4.0, 3.0], [1.0, -2.0], [2.0, 1.0], [2.0, 1.0]])
    )
    times = np.array([0.0, 2.0, 3.0, 5.0, 7.0, 8.5, 9.0, 11.0, 12.0, 50.0])

    np.testing.assert_allclose(
        turns.at(times),
        [0.0, 0.0, 0.5, 1.0, 0.5, -1.0, -2.0, -2.0, 0.0, 0.0],
    )


def test_rule_b_is_that_of_libigc(flights):
    """Its decoder reads the positions as a log."""
    pytest.importorskip("libigc")
    same = []
    for flight in flights[:6]:
        times = np.arange(flight.times[-1])
        positions = np.column_stack(
            [np.interp(times, flight.times, axis) for axis in flight.positions.T]
        )
        log = parse_igc(
            "log",
            write_log(
                positions,
                np.interp(times, flight.times, flight.altitudes) + 1500.0,
            ),
        )
        read = glider_flight("log", "A", log)
        decoded = decode(log.records)
        (ours,), theirs = label_gliders([read]), label_glider(read, air_motion([read])[0], decoded)
        same.append((ours.own == theirs.own)[decoded >= 0])

    assert np.concatenate(same).mean() > 0.98
