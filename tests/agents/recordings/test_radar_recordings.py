"""Recordings of a radar: columns of range, bearing and range rate."""

import json
from dataclasses import replace

import numpy as np
import pytest
from recorded_tracks import OBJECTS

from agents import track_recording
from baselines import read_recordings
from hybrid_env import Radar

RADAR = Radar(
    range_deviation=30.0, bearing_deviation=0.015, rate_deviation=0.3, position=(3000.0, -8700.0)
)
SHIP = OBJECTS["ship"]
TRUE = np.repeat([0, 1, 0, 2, 0], 40)
TIMES = SHIP.times(len(TRUE))


@pytest.fixture(scope="module")
def polar():
    """Range, bearing from the x axis and range rate at every tick, (T, 3), one of them missing."""
    truth = SHIP.simulate(1, 3, "SLSRS", 5 * (40,)).truth[0]
    away, velocity = truth[:, ::2] - RADAR.position, truth[:, 1::2]
    length = np.hypot(*away.T)
    rates = (away * velocity).sum(1) / length
    rows = np.stack([length, np.arctan2(*away.T[::-1]), rates], axis=1)
    rows += np.random.default_rng(3).normal(size=rows.shape) * (30.0, 0.015, 0.3)
    rows[70] = np.nan
    return rows


def write(path, rows, names):
    lines = [
        ",".join(map(str, row)).replace("nan", "")
        for row in np.column_stack([TIMES, rows]).tolist()
    ]
    path.write_text("\n".join([names, *lines]) + "\n")
    return path


def test_modes_and_radius_are_found_from_a_radar_alone(polar):
    tracked = track_recording(TIMES, polar, radar=RADAR)
    assert (tracked.modes == TRUE).mean() > 0.9
    assert tracked.model.radii[0] == pytest.approx(SHIP.radius, rel=0.05)
    settings = json.loads(json.dumps(tracked.settings(), allow_nan=False))
    assert Radar(**settings["radar"]) == RADAR
    # Range and bearing alone tell less.
    without_rate = replace(RADAR, rate_deviation=None)
    known = track_recording(
        TIMES, polar[:, :2], radar=without_rate, lengths=(40,), radii=(SHIP.radius,)
    )
    assert known.pieces[:, 2].tolist() == [0, 1, 0, 2, 0]
    assert known.settings()["known_switches"]


def test_degrees_from_north_and_radians_from_the_x_axis_are_the_same(polar, tmp_path):
    degrees = np.column_stack([polar[:, 0], (90.0 - np.degrees(polar[:, 1])) % 360.0, polar[:, 2]])
    files = (
        write(tmp_path / "a.csv", degrees, "time,range [m],bearing,range_rate"),
        write(tmp_path / "b.csv", polar, "time,range [m],azimuth [rad],doppler"),
    )
    read = [read_recordings(path, radar=RADAR) for path in files]
    first, second = (file.recordings[0] for file in read)

    np.testing.assert_allclose(first.positions, second.positions)
    np.testing.assert_array_equal(first.rates, polar[:, 2:])
