"""Latitude and longitude, also under the names x and y."""

import numpy as np
import pandas as pd
import pytest
from pyproj import Geod

from baselines.recordings.projection import Projection, centred_projection
from baselines.recordings.reading.read import read_recordings
from hybrid_env.checks import ArgumentError

ROWS = 50
GEOD = Geod(ellps="WGS84")


def degrees(latitude, longitude, speed, tick=1.0):
    """Times, latitudes and longitudes of a wavy path of so many metres a second, and its steps [m]."""
    headings = 40.0 + 30.0 * np.sin(0.1 * np.arange(ROWS - 1))
    points = [(longitude, latitude)]
    for heading in headings:
        points.append(GEOD.fwd(*points[-1], heading, speed * tick)[:2])
    longitudes, latitudes = np.transpose(points)
    steps = speed * tick * np.column_stack([np.sin(np.radians(headings)), np.cos(np.radians(headings))])
    return pd.DataFrame({"t": tick * np.arange(ROWS), "lat": latitudes, "lon": longitudes}), steps


def read(tmp_path, frame, **options):
    frame.to_csv(tmp_path / "walk.csv", index=False)
    file = read_recordings(tmp_path / "walk.csv", **options)
    return file.recordings[0], file.summary


PLACES = [
    (55.75, 37.6, 1.4),
    (-33.9, 151.2, 20.0),
    (0.0, 0.0, 5.0),
    (60.0, 179.9999, 5.0),
    (69.6, -179.99, 250.0),
]


@pytest.mark.parametrize(("latitude", "longitude", "speed"), PLACES)
def test_degrees_become_metres_east_and_north(tmp_path, latitude, longitude, speed):
    frame, steps = degrees(latitude, longitude, speed)
    recording, summary = read(tmp_path, frame)
    found = np.diff(recording.positions, axis=0)
    np.testing.assert_allclose(np.hypot(*found.T), speed, rtol=1e-5)
    np.testing.assert_allclose(found, steps, atol=0.01 * speed)  # north is not parallel everywhere
    assert recording.unit == "m"
    assert "degrees projected to metres around" in summary
    back = recording.projection.inverse(recording.positions)
    np.testing.assert_allclose(back[:, 0], frame.lat, atol=1e-9)
    np.testing.assert_allclose((back[:, 1] - frame.lon + 180.0) % 360.0, 180.0, atol=1e-9)


def test_distances_from_the_centre_are_those_of_the_ellipsoid():
    projection = Projection(48.0, 11.0)
    longitudes, latitudes, _ = GEOD.fwd(
        *np.full((2, 8), [[11.0], [48.0]]), np.arange(8) * 45.0, np.full(8, 5e5)
    )
    positions = projection.forward(latitudes, longitudes)
    np.testing.assert_allclose(np.hypot(*positions.T), 5e5, rtol=1e-9)
    np.testing.assert_allclose(np.degrees(np.arctan2(*positions.T)) % 360.0, np.arange(8) * 45.0, atol=1e-6)
    missing = projection.forward([48.0, np.nan], [11.0, 11.0])
    np.testing.assert_allclose(missing, [[0.0, 0.0], [np.nan, np.nan]], atol=1e-9)
    assert centred_projection([10.0, 20.0], [179.0, -179.0]) == Projection(15.0, -180.0)


@pytest.mark.parametrize("tick", [0.1, 1.0, 10.0])
@pytest.mark.parametrize(("latitude", "longitude", "speed"), PLACES[:2] + PLACES[4:])
def test_degrees_under_the_names_x_and_y_are_refused_with_the_option(
    tmp_path, latitude, longitude, speed, tick
):
    frame, _ = degrees(latitude, longitude, speed, tick)
    named = frame.rename(columns={"lon": "x", "lat": "y"})
    with pytest.raises(ArgumentError, match=r"look like degrees: --unit deg .* or --unit m"):
        read(tmp_path, named)
    recording, summary = read(tmp_path, named, unit="deg")
    np.testing.assert_array_equal(recording.positions, read(tmp_path, frame)[0].positions)
    assert "x taken as longitude and y as latitude" in summary
    plane, _ = read(tmp_path, named, unit="m")
    np.testing.assert_array_equal(plane.positions, named[["x", "y"]])
    in_header, _ = read(tmp_path, named.rename(columns={"x": "x [deg]", "y": "y [deg]"}))
    np.testing.assert_array_equal(in_header.positions, recording.positions)


@pytest.mark.parametrize("scale", [1.0, 1e-3, 60.0, 1e3])
@pytest.mark.parametrize("offset", [0.0, 0.5])
def test_metres_and_kilometres_of_what_moves_are_not_taken_for_degrees(tmp_path, scale, offset):
    generator = np.random.default_rng(0)
    heading = np.cumsum(generator.normal(0.0, 0.05, 400))
    track = np.cumsum(0.14 * np.column_stack([np.cos(heading), np.sin(heading)]), axis=0)
    track = scale * (track + offset * np.ptp(track) + generator.normal(0.0, 0.1, (400, 2)))
    recording, _ = read(
        tmp_path, pd.DataFrame({"t": 0.1 * np.arange(400), "x": track[:, 0], "y": track[:, 1]})
    )
    np.testing.assert_allclose(recording.positions, track)


@pytest.mark.parametrize(
    ("column", "value", "message"),
    [
        ("lat", 90.5, r"line 12: lat=90.5"),
        ("lon", -361.0, r"line 12: lon=-361.0"),
        ("lat", "N 55", "lat='N 55'"),
    ],
)
def test_degrees_out_of_range_are_refused(tmp_path, column, value, message):
    frame, _ = degrees(55.75, 37.6, 1.4)
    frame[column] = frame[column].astype(object)
    frame.loc[10, column] = value
    with pytest.raises(ArgumentError, match=message):
        read(tmp_path, frame)
    with pytest.raises(ArgumentError, match=r"unit='km'.*latitudes and longitudes"):
        read(tmp_path, frame, unit="km")
