"""Objects that stand for a while, and recordings with modes of the user."""

import numpy as np
import pytest
from recorded_tracks import directions, follow
from scipy.signal import lfilter

from agents.interface.output_files import write_json
from agents.recordings.tracking import track_recording
from baselines import OnlineTracker
from baselines.recordings.recording import make_recording
from baselines.recordings.scatter import without_standing
from baselines.recordings.ticks import tick_grid
from hybrid_env.checks import ArgumentError
from hybrid_env.modes import LinearMode, Straight, Turn

# Speed, tick, deviation of the noise, smallest shares of right rows and of those of stops, radius
# of the turns, and the modes with their ticks.
OBJECTS = {
    "walker": (1.4, 1.0, 0.5, 0.9, 0.95, 10.0, "S 100 stop 90 S 80 L 40 stop 60"),
    "short stops": (1.4, 1.0, 0.5, 0.65, 0.7, 10.0, 4 * "S 30 L 30 S 20 stop 5 S 20 "),
    "robot": (0.5, 0.1, 0.02, 0.95, 0.95, 1.0, "S 200 stop 600 L 100 S 200"),
    "ship": (5.0, 10.0, 10.0, 0.95, 0.95, 800.0, "S 120 stop 300 S 100 R 60 S 90"),
    "at first": (1.2, 1.0, 0.3, 0.9, 0.95, 8.0, "stop 80 S 100 L 40 S 80"),
}
SIDES = {"S": 0.0, "L": 1.0, "R": -1.0, "stop": 0.0}


def glide(modes, speed, radius, share=1.0, slowing=1.0):
    """Return positions (T, 2) of an object that nears the speed of a mode by a share of the
    difference in each tick, and its side by another share.
    """
    position, heading, step, side, positions = np.zeros(2), 0.4, speed, 0.0, []
    for mode in modes:
        step += slowing * ((0.0 if mode == "stop" else speed) - step)
        side += share * (SIDES[mode] - side)
        heading += side * step / radius
        position = position + step * directions(heading)
        positions.append(position)
    return np.array(positions)


def recorded(name, seed=1):
    """Return times, measured positions and modes of an object."""
    speed, tau, deviation, _, _, radius, parts = OBJECTS[name]
    modes = np.repeat(parts.split()[::2], np.array(parts.split()[1::2], int))
    positions = glide(modes, speed * tau, radius)
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
    steps = np.append(0.0, rng.normal(size=599))
    logarithms = lfilter([0.15], [1.0, -0.97], steps)
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


def test_pieces_begin_where_the_motion_begins_to_change():
    """A car of 12 m/s at ten rows a second that steers within half a second and brakes within
    one."""
    modes = np.repeat(3 * ["S", "L", "stop", "R"], 3 * [80, 60, 70, 60])
    positions = glide(modes, 1.2, 20.0, 0.2, 0.1)
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
    drift = lfilter([0.5], [1.0, -0.985], rng.normal(size=(900, 2)), axis=0)
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
    measured = length * (glide(truth, 1.2, 20.0, 1.0, 0.1) + rng.normal(0.0, 0.1, (len(truth), 2)))
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


STILL = LinearMode(np.diag([1.0, 0.0, 1.0, 0.0]), name="still")


@pytest.mark.parametrize("modes", ["straight, left 1, stop", (Straight(), Turn(1.0), STILL)])
def test_modes_may_be_given_as_texts_and_as_matrices(modes, tmp_path):
    """Those that are given are not searched; they have the units of the recording."""
    times, positions, truth = recorded("robot")
    tracked = track_recording(times, positions, modes=modes, live=True)
    letters, _ = tracked.of_modes(tracked.modes)
    assert np.mean(letters == np.where(truth == "stop", tracked.mode_names()[2], truth)) > 0.9
    assert tracked.mode_names()[:2] == ["S", "L"]
    # The file has their matrices.
    write_json(tmp_path / "track.json", tracked.settings())
    tracker = OnlineTracker.from_recording(tmp_path / "track.json")
    assert tracker.options == OnlineTracker.from_recording(tracked).options
    live = follow(tracker, times, positions)
    assert [now.mode for now in live[-50:]] == tracked.modes[-50:].tolist()
    with pytest.raises(ArgumentError, match="modes"):
        track_recording(times, positions, modes="straight, jump")
