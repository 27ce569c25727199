"""Latitude and longitude, also under the names x and y."""

import numpy as np
import pandas as pd
import pytest
from made_up_glider import degrees_of
from pyproj import Geod
from recorded_tracks import directions

from hybrid_env.checks import ArgumentError

ROWS = 50
GEOD = Geod(ellps="WGS84")
PLACES = [(55.75, 37.6, 1.4), (-33.9, 151.2, 20.0), (0.0, 0.0, 5.0), (69.6, -179.99, 250.0)]


def degrees(latitude, longitude, speed, tick=1.0):
    """Times, latitudes and longitudes of a wavy path of so many metres a second, and its steps
    [m].
    """
    headings = 40.0 + 30.0 * np.sin(0.1 * np.arange(ROWS - 1))
    points = [(longitude, latitude)]
    for heading in headings:
        points.append(GEOD.fwd(*points[-1], heading, speed * tick)[:2])
    longitudes, latitudes = np.transpose(points)
    steps = speed * tick * directions(np.radians(90.0 - headings))
    return pd.DataFrame({"t": tick * np.arange(ROWS), "lat": latitudes, "lon": longitudes}), steps


@pytest.mark.parametrize(("latitude", "longitude", "speed"), PLACES)
def test_degrees_become_metres_east_and_north(read, latitude, longitude, speed):
    frame, steps = degrees(latitude, longitude, speed)
    file = read(frame)
    [recording] = file.recordings
    found = np.diff(recording.positions, axis=0)

    np.testing.assert_allclose(np.hypot(*found.T), speed, rtol=1e-5)
    # North is not parallel everywhere.
    np.testing.assert_allclose(found, steps, atol=0.01 * speed)
    assert recording.unit == "m"
    assert "degrees projected to metres around" in file.summary
    back = degrees_of(recording.projection, recording.positions)
    np.testing.assert_allclose(back[:, 0], frame.lat, atol=1e-9)
    np.testing.assert_allclose((back[:, 1] - frame.lon + 180.0) % 360.0, 180.0, atol=1e-9)


@pytest.mark.parametrize(("tick", "place"), [(0.1, PLACES[0]), (10.0, PLACES[-1])])
def test_degrees_under_the_names_x_and_y_are_refused_with_the_option(read, read_one, place, tick):
    frame, _ = degrees(*place, tick)
    named = frame.rename(columns={"lon": "x", "lat": "y"})
    with pytest.raises(ArgumentError, match=r"look like degrees: --unit deg .* or --unit m"):
        read(named)
    file = read(named, unit="deg")

    np.testing.assert_array_equal(file.recordings[0].positions, read_one(frame).positions)
    assert "x taken as longitude and y as latitude" in file.summary
    np.testing.assert_array_equal(read_one(named, unit="m").positions, named[["x", "y"]])


@pytest.mark.parametrize(("scale", "offset"), [(1.0, 0.0), (1e-3, 0.5), (60.0, 0.5)])
def test_metres_and_kilometres_of_what_moves_are_not_taken_for_degrees(read_one, scale, offset):
    generator = np.random.default_rng(0)
    heading = np.cumsum(generator.normal(0.0, 0.05, 400))
    track = np.cumsum(0.14 * directions(heading), axis=0)
    track = scale * (track + offset * np.ptp(track) + generator.normal(0.0, 0.1, (400, 2)))
    frame = pd.DataFrame({"t": 0.1 * np.arange(400), "x": track[:, 0], "y": track[:, 1]})

    np.testing.assert_allclose(read_one(frame).positions, track)
