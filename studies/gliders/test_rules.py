"""Rules for circles against literal loops, and several settings together."""

import numpy as np
import pytest
from made_up_glider import fly, write_log

from baselines import parse_igc
from studies.flights.flight import stack_flights
from studies.flights.tracks import FlightTracks
from studies.flights.turns import run_turn_imm
from studies.gliders.logs import glider_flight
from studies.gliders.rules import AngleRule, GliderImm, XcsoarDefault, XcsoarRule


@pytest.fixture(scope="module")
def tracks():
    flights = []
    for seed in (1, 2):
        _, positions, altitudes = fly(seed, noise=1.5)
        flights.append(
            glider_flight(
                "log",
                "A",
                parse_igc("log", write_log(positions, altitudes)),
            )
        )
    batch = stack_flights(flights)
    return FlightTracks(batch, run_turn_imm(batch, GliderImm.models[0]))


def told(tracks, rule):
    return rule.statements(tracks)[..., 0]


def ground_turns(tracks):
    points = tracks.batch.positions
    found = np.zeros(points.shape[:2])
    for j in range(points.shape[1]):
        angle = None
        for k in range(1, len(points)):
            dx, dy = points[k, j] - points[k - 1, j]
            now = np.arctan2(dy, dx)
            if angle is not None:
                found[k, j] = (now - angle + np.pi) % (2.0 * np.pi) - np.pi
            angle = now
    return found


def literal_xcsoar(turns, rate, enter, leave):
    smooth = 0.0
    since = None
    mode = 0
    said = []
    for k, turned in enumerate(turns):
        if k:
            smooth = 0.7 * smooth + 0.3 * max(min(np.degrees(turned), 50.0), -50.0)
        side = 1 if smooth > 0.0 else 2
        turning = abs(smooth) >= rate
        if turning == (mode > 0):
            since = None
        else:
            since = k if since is None else since
            if k - since > (leave if mode else enter):
                mode, since = (0 if mode else side), None
        if mode and turning:
            mode = side
        said.append(mode)
    return said


@pytest.mark.parametrize(
    "setting",
    [(4.0, 15.0, 10.0), (8.0, 4.0, 0.0), (6.0, 10.0, 3.0)],
)
def test_xcsoars_rule_is_that_of_a_literal_loop(tracks, setting):
    turns = ground_turns(tracks)
    np.testing.assert_allclose(
        tracks.turned,
        turns,
        atol=1e-9,
    )
    expected = np.stack(
        [literal_xcsoar(one, *setting) for one in turns.T],
        axis=1,
    )
    np.testing.assert_array_equal(
        told(tracks, XcsoarRule(setting)),
        expected,
    )
    if setting == XcsoarDefault.usual:
        np.testing.assert_array_equal(told(tracks, XcsoarDefault()), expected)


def test_the_angle_rule_is_that_of_a_literal_loop(tracks):
    memory = 12.0
    enter = np.radians(120.0)
    leave = np.radians(45.0)
    said = told(tracks, AngleRule((12.0, 120.0, 45.0)))
    for column, turns in enumerate(ground_turns(tracks).T):
        angle = recent = mode = 0
        for k, turned in enumerate(turns):
            angle = angle * np.exp(-(k > 0) / memory) + turned
            recent = recent * np.exp(-(k > 0) / 8.0) + turned
            if mode and (recent if mode == 1 else -recent) <= leave:
                mode = 0
            if abs(angle) >= enter and abs(recent) > leave and angle * recent > 0.0:
                mode = 1 if angle > 0.0 else 2
            assert said[k, column] == mode
