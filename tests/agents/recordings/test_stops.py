"""Objects that stand for a while, and recordings with modes of the user."""

import numpy as np
import pandas as pd
import pytest
from recorded_tracks import directions, write_recording

from agents.cli import main
from agents.interface.output_files import write_json
from agents.recordings.tracking import track_recording
from baselines import OnlineTracker
from baselines.recordings.recording import make_recording
from baselines.recordings.scatter import without_standing
from baselines.recordings.ticks import tick_grid
from hybrid_env.checks import ArgumentError
from hybrid_env.modes import LinearMode

# Speed, tick, deviation of the noise, smallest shares of right rows and of those of stops, and
# parts: mode, ticks, and radius of a turn, or change of the heading before the part [rad].
TRIP = [("S", 30, 0.0), ("L", 30, 10.0), ("S", 20, 0.0), ("stop", 5, 0.0), ("S", 20, -1.0)]
OBJECTS = {
    "walker": (
        *(1.4, 1.0, 0.5, 0.9, 0.95),
        [("S", 100, 0.0), ("stop", 90, 0.0), ("S", 80, 2.0), ("L", 40, 10.0), ("stop", 60, 0.0)],
    ),
    "short stops": (1.4, 1.0, 0.5, 0.65, 0.7, 4 * TRIP),
    "robot": (
        *(0.5, 0.1, 0.02, 0.95, 0.95),
        [("S", 200, 0.0), ("stop", 600, 0.0), ("L", 100, 1.0), ("S", 200, 0.0)],
    ),
    "ship": (
        *(5.0, 10.0, 10.0, 0.95, 0.95),
        [("S", 120, 0.0), ("stop", 300, 0.0), ("S", 100, 1.0), ("R", 60, 800.0), ("S", 90, 0.0)],
    ),
    "at first": (
        *(1.2, 1.0, 0.3, 0.9, 0.95),
        [("stop", 80, 0.0), ("S", 100, 0.0), ("L", 40, 8.0), ("S", 80, 0.0)],
    ),
}


SIDES = {"S": 0.0, "L": 1.0, "R": -1.0, "stop": 0.0}


def travel(parts, speed):
    """Return positions (T, 2) and modes (T,) of an object that changes its motion at once, with
    the speed of a tick.
    """
    modes = np.repeat([mode for mode, _, _ in parts], [ticks for _, ticks, _ in parts])
    position, heading, positions = np.zeros(2), 0.4, []
    for mode, ticks, value in parts:
        heading += value if mode == "S" else 0.0
        step = 0.0 if mode == "stop" else speed
        bend = SIDES[mode] and SIDES[mode] * step / value
        for _ in range(ticks):
            heading += 0.5 * bend
            position = position + step * directions(heading)
            heading += 0.5 * bend
            positions.append(position)
    return np.array(positions), modes


def glide(modes, speed, radius, share):
    """Return positions (T, 2) of an object that nears the speed of a mode by a tenth of the
    difference in each tick, and its side by another share.
    """
    position, heading, step, side, positions = np.zeros(2), 0.4, speed, 0.0, []
    for mode in modes:
        step += 0.1 * ((0.0 if mode == "stop" else speed) - step)
        side += share * (SIDES[mode] - side)
        heading += side * step / radius
        position = position + step * directions(heading)
        positions.append(position)
    return np.array(positions)


def recorded(name, seed=1):
    """Return times, measured positions and modes of an object."""
    speed, tau, deviation, *_, parts = OBJECTS[name]
    positions, modes = travel(parts, speed * tau)
    noise = np.random.default_rng(seed).normal(0.0, deviation, positions.shape)
    return tau * np.arange(len(modes)), positions + noise, modes


@pytest.mark.parametrize("name", OBJECTS)
def test_stops_are_found(name):
    """Rows are right; the object has no speed where it stands, after the decision."""
    times, positions, modes = recorded(name)

    tracked = track_recording(times, positions)

    letters, radii = tracked.of_modes(tracked.modes)
    assert tracked.mode_names() == ["S", "L", "R", "stop"]
    least, least_of_stops = OBJECTS[name][3:5]
    assert np.mean(letters == modes) > least
    assert np.mean((letters == "stop")[modes == "stop"]) > least_of_stops
    stands = (letters == "stop") & tracked.decided
    assert (tracked.turns[stands, :2] == 0.0).all()
    assert np.isnan(radii[stands]).all()
    assert tracked.standing == 0
    assert "modes" in tracked.model.estimated


@pytest.mark.parametrize("kind", ["varies", "turns back"])
def test_an_object_that_is_slow_for_a_moment_does_not_stop(kind):
    """A window of it looks like noise."""
    rng = np.random.default_rng([0, 5])
    logarithms = np.zeros(600)
    for k in range(1, 600):
        logarithms[k] = 0.97 * logarithms[k - 1] + 0.15 * rng.normal()
    speed = {
        "varies": 3.0 * np.exp(logarithms),
        "turns back": 10.0 * np.clip(1.5 * np.cos(np.arange(600) * np.pi / 40.0), -1.0, 1.0),
    }[kind]
    positions = np.cumsum(speed)[:, None] * np.array([0.8, 0.6])
    positions += rng.normal(0.0, 1.0, (600, 2))

    assert without_standing(tick_grid(make_recording(None, positions)))[1] > 0
    assert track_recording(None, positions).mode_names() == ["S", "L", "R"]


def test_a_decider_of_turns_leaves_the_stops_out():
    """It states no mode there, and goes on after each stop."""
    times, positions, _ = recorded("robot")

    tracked = track_recording(times, positions, decider="shipped", live=True)

    assert tracked.mode_names() == ["S", "L", "R"]
    assert abs(tracked.standing - 600) <= 20
    assert len(tracked.grid.pieces) == 2
    known = tracked.modes >= 0
    assert known.sum() == len(times) - tracked.standing


def test_modes_may_be_given(tmp_path, capsys):
    """Those of a text are not searched; they have the units of the recording."""
    times, positions, modes = recorded("robot")
    file = write_recording(tmp_path / "robot.csv", times, positions)

    assert main(["track", str(file), "--modes", "straight, left 1, stop", "--no-png"]) == 0

    assert "modes S, L, stop" in " ".join(capsys.readouterr().out.split())
    rows = pd.read_csv(tmp_path / "robot_track" / "estimates.csv")
    assert np.mean(rows["mode"] == modes) > 0.95
    with pytest.raises(ArgumentError, match="modes"):
        track_recording(times, positions, modes="straight, jump")


def test_a_recording_of_an_oscillator_is_tracked_by_linear_modes(tmp_path):
    """Two frequencies, of which no line and no arc is part; the file has their matrices."""
    rng = np.random.default_rng(0)

    def swing(angle, name):
        axis = [[np.cos(angle), np.sin(angle) / angle], [-np.sin(angle) * angle, np.cos(angle)]]
        return LinearMode(np.kron(np.eye(2), axis), None, None, name)

    modes = swing(0.3, "fast"), swing(0.1, "slow")
    state = np.array([0.0, 2.0, 1.0, 0.0])
    truth = np.repeat([0, 1, 0, 1], 100)
    positions = []
    for mode in truth:
        state = modes[mode].F @ state
        positions.append(state[::2])
    measured = 1e3 * (np.array(positions) + rng.normal(0.0, 0.1, (len(truth), 2)))

    tracked = track_recording(None, measured, modes=modes, live=True)

    assert tracked.mode_names() == ["fast", "slow"]
    assert np.mean(tracked.modes == truth) > 0.9
    write_json(tmp_path / "track.json", tracked.settings())
    tracker = OnlineTracker.from_recording(tmp_path / "track.json")
    live = [tracker.update(point) for point in measured]
    np.testing.assert_allclose(live[-1].estimate, tracked.estimates[-1])
    assert [now.mode for now in live[-50:]] == tracked.modes[-50:].tolist()


def test_pieces_begin_where_the_motion_begins_to_change():
    """A car of 12 m/s at ten rows a second that steers within half a second and brakes within
    one."""
    modes = np.repeat(3 * ["S", "L", "stop", "R"], 3 * [80, 60, 70, 60])
    positions = glide(modes, 1.2, 20.0, 0.2)
    positions += np.random.default_rng(1).normal(0.0, 0.1, positions.shape)
    tracked = track_recording(0.1 * np.arange(len(modes)), positions)

    letters, _ = tracked.of_modes(tracked.modes)
    assert np.mean(letters == modes) > 0.95
    begins = np.flatnonzero((modes == "stop") & (np.roll(modes, 1) != "stop"))
    found = tracked.pieces[letters[tracked.pieces[:, 0]] == "stop", 0]
    assert len(found) == len(begins)
    assert np.abs(found - begins).max() <= 3


def test_a_receiver_that_stands_does_not_turn_although_its_position_drifts():
    """By four metres within some minutes, as of a GPS."""
    rng = np.random.default_rng(2)
    drift = np.zeros((900, 2))
    for k in range(1, 900):
        drift[k] = 0.985 * drift[k - 1] + rng.normal(0.0, 0.5, 2)
    standing = drift + rng.normal(0.0, 0.3, drift.shape)
    walking = standing + 1.4 * np.clip(np.arange(900) - 600, 0, None)[:, None] * [0.8, 0.6]
    for positions, modes in ((standing, ["stop"]), (walking, ["stop", "S"])):
        tracked = track_recording(np.arange(900), positions)
        letters, _ = tracked.of_modes(tracked.pieces[:, 2])
        assert letters.tolist() == modes
        assert np.abs(tracked.pieces[1:, 0] - 600).max(initial=0) <= 5


@pytest.mark.parametrize(("length", "tau"), [(1.0, 0.1), (1000.0, 0.02)])
def test_a_live_stop_is_stated_while_the_object_slows_down(length, tau):
    """Its speed falls by a factor of e in ten ticks, from 12 deviations of the noise in a tick."""
    rng = np.random.default_rng(3)
    order = ["S", "stop", "L", "S", "stop", "R", "S", "stop", "L", "stop", "R", "S"]
    truth = np.repeat(order, 100)
    measured = length * (glide(truth, 1.2, 20.0, 1.0) + rng.normal(0.0, 0.1, (len(truth), 2)))
    tracked = track_recording(tau * np.arange(len(truth)), measured, live=True)

    assert 3.0 < tracked.model.stopping_time / tau < 30.0
    assert tracked.mode_names() == ["S", "L", "R", "stop"]
    np.testing.assert_allclose(tracked.probabilities[10:].sum(1), 1.0)
    letters, _ = tracked.of_modes(tracked.modes)
    begins = np.flatnonzero((truth[1:] == "stop") & (truth[:-1] != "stop")) + 1
    delays = [int((letters[begin:] == "stop").argmax()) for begin in begins]
    # Of the speed 5 % are left after 30 ticks.
    assert np.mean(delays) < 15
    assert (letters == truth).mean() > 0.85
