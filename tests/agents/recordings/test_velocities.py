"""Measured velocities, as from speed and course over ground: what a file says of them, and how much
earlier a mode is decided.
"""

import numpy as np
import pandas as pd
import pytest
from recorded_tracks import OBJECTS

from agents import track_recording
from baselines import OnlineTracker
from baselines.recordings.reading.read import read_recordings

KNOT = 1852.0 / 3600.0
# Standard deviation of each coordinate of a velocity, over the speed.
SHARE = 0.01


def drive(name, seed=3, pieces="SLSRSRSLSLSR", length=60):
    """Return times, positions, velocities and modes of an object."""
    target = OBJECTS[name]
    run = target.simulate(1, seed, pieces, (length,) * len(pieces))
    noise = np.random.default_rng(seed).normal(size=(len(run.truth[0]), 2))
    velocities = run.truth[0][:, 1::2] + SHARE * target.speed * noise
    modes = np.repeat(["SLR".index(letter) for letter in pieces], length)
    return target.times(len(modes)), run.measurements[0], velocities, modes


def delays_and_changes(tracked, modes):
    """Return the mean delay of a switch in ticks, and how many changes of the mode are too many."""
    sides = np.sign([mode.signed_radius for mode in tracked.model.all_modes])
    stated = np.array([0, 1, 2])[sides.astype(int)[tracked.modes]]
    switches = np.flatnonzero(np.diff(modes)) + 1
    delays = [np.argmax(stated[k : k + 60] == modes[k]) for k in switches]
    return np.mean(delays), np.count_nonzero(np.diff(stated)) - len(switches)


@pytest.mark.parametrize("name", ["ship", "aircraft"])
def test_a_live_mode_is_decided_in_half_the_time(name):
    times, positions, velocities, modes = drive(name)
    both = np.hstack([positions, velocities])
    blind, seeing = (track_recording(times, each, live=True) for each in (positions, both))
    (slow, more), (fast, extra) = (delays_and_changes(each, modes) for each in (blind, seeing))
    assert fast <= 0.5 * slow
    assert extra <= more
    deviation = SHARE * OBJECTS[name].speed
    # The simplex method stops at a tenth.
    assert seeing.model.velocity_variance == pytest.approx(deviation**2, rel=0.2)


def test_hindsight_reads_velocities_and_a_live_tracker_goes_on_with_them():
    times, positions, velocities, modes = drive("ship")
    tracked = track_recording(times, np.hstack([positions, velocities]))
    assert delays_and_changes(tracked, modes) == (0.0, 0)
    errors = np.linalg.norm(tracked.estimates[:, 1::2] - velocities, axis=1)
    assert np.median(errors) < 2.0 * SHARE * OBJECTS["ship"].speed

    live = OnlineTracker.from_recording(tracked)
    known = [live.update(*row) for row in zip(positions, times, velocities, strict=True)]
    error = np.linalg.norm(known[-1].estimate[1::2] - velocities[-1])
    assert error < 3.0 * SHARE * OBJECTS["ship"].speed
    blind = OnlineTracker.from_recording(track_recording(times, positions))
    with pytest.raises(ValueError, match="no single sensor"):
        blind.update(positions[0], 0.0, velocities[0])


def write(path, velocities, positions, times, **columns):
    """Write a file with speed and course."""
    course = (90.0 - np.degrees(np.arctan2(velocities[:, 1], velocities[:, 0]))) % 360.0
    speed = np.linalg.norm(velocities, axis=1) / KNOT
    frame = {"t": times, "x [m]": positions[:, 0], "y [m]": positions[:, 1]}
    pd.DataFrame(frame | {"SOG": speed, "COG": course} | columns).to_csv(path, index=False)
    return read_recordings(path)


def test_unit_and_direction_of_speed_and_course_are_those_that_agree_with_the_positions(tmp_path):
    times, positions, velocities, _ = drive("ship")
    file = write(tmp_path / "a.csv", velocities, positions, times)
    assert "speed and course used: kn, course in degrees from north" in file.summary
    np.testing.assert_allclose(file.recordings[0].rates, velocities, rtol=1e-9)

    # North, east and down, in km/h.
    swapped = {"x [m]": positions[:, 1], "y [m]": positions[:, 0]}
    columns = swapped | {"vx": 3.6 * velocities[:, 1], "vy": 3.6 * velocities[:, 0]}
    pd.DataFrame({"t": times} | columns).to_csv(tmp_path / "b.csv", index=False)
    file = read_recordings(tmp_path / "b.csv", frame="ned")
    assert "velocities used: km/h, y and x" in file.summary
    np.testing.assert_allclose(file.recordings[0].rates, velocities, rtol=1e-9)


def test_what_contradicts_the_positions_is_said_and_not_used(tmp_path):
    times, positions, velocities, _ = drive("ship")
    course = np.random.default_rng(0).uniform(0.0, 360.0, len(times))
    file = write(tmp_path / "a.csv", velocities, positions, times, COG=course)
    assert "speed and course contradict the positions" in file.summary
    assert file.recordings[0].rates.shape[1] == 0
    # A message that says that its course is not known.
    velocities[7] *= -1.0
    file = write(tmp_path / "b.csv", velocities, positions, times)
    assert "1 of them contradict the positions" in file.summary
    assert np.flatnonzero(np.isnan(file.recordings[0].rates[:, 0])).tolist() == [7]
