"""Recordings of a radar: columns of range, bearing and range rate."""

import math

import numpy as np
import pytest

from agents import track_recording
from agents.commands.track import Track
from baselines import read_recordings
from hybrid_env import ArgumentError, Radar
from hybrid_env.sensors import parse_sensors

RADAR = Radar(
    range_deviation=30.0,
    bearing_deviation=0.015,
    rate_deviation=0.3,
    position=(3000.0, -8700.0),
)
TEXT = "30 0.015 rate 0.3 at 3000 -8700"
# A ship.
TAU, SPEED, RADIUS = 10.0, 8.0, 500.0
TRUE = np.repeat([0, 1, 0, 2, 0], 40)
TIMES = TAU * np.arange(len(TRUE))


@pytest.fixture(scope="module")
def polar():
    """Range, bearing from the x axis and range rate at every tick, (T, 3), one of them missing."""
    generator = np.random.default_rng(3)
    heading = np.cumsum(SPEED * TAU / RADIUS * np.array([0, 1, -1])[TRUE])
    velocity = SPEED * np.stack([np.cos(heading), np.sin(heading)], 1)
    away = np.cumsum(TAU * velocity, axis=0) - RADAR.position
    length = np.hypot(*away.T)
    noise = generator.normal(size=(3, len(TRUE)))
    rows = np.stack(
        [
            length + 30.0 * noise[0],
            np.arctan2(*away.T[::-1]) + 0.015 * noise[1],
            (away * velocity).sum(1) / length + 0.3 * noise[2],
        ],
        axis=1,
    )
    rows[70] = np.nan
    return rows


def write(path, rows, names):
    lines = [
        ",".join(map(str, row)).replace("nan", "")
        for row in np.column_stack([TIMES, rows]).tolist()
    ]
    path.write_text("\n".join([names, *lines]) + "\n")
    return path


@pytest.mark.parametrize("decider", ["threshold", "beam"])
def test_modes_and_radius_are_found_from_a_radar_alone(polar, decider):
    found = track_recording(TIMES, polar, radar=RADAR, decider=decider)
    assert (found.modes == TRUE).mean() > 0.9
    assert found.model.radii[0] == pytest.approx(RADIUS, rel=0.05)
    assert found.warnings == []
    known = track_recording(TIMES, polar, radar=RADAR, lengths=(40,), radii=(RADIUS,))
    assert known.pieces[:, 2].tolist() == [0, 1, 0, 2, 0]
    # Range and bearing alone tell less.
    less = track_recording(
        TIMES,
        polar[:, :2],
        radar=Radar(**vars(RADAR) | {"rate_deviation": None}),
    )
    assert (less.modes == TRUE).mean() > 0.8


def test_degrees_from_north_and_radians_from_the_x_axis_are_the_same(polar, tmp_path):
    degrees = np.column_stack([polar[:, 0], (90.0 - np.degrees(polar[:, 1])) % 360.0, polar[:, 2]])
    files = (
        write(tmp_path / "a.csv", degrees, "time,range [m],bearing,range_rate"),
        write(tmp_path / "b.csv", polar, "time,range [m],azimuth [rad],doppler"),
    )
    read = [read_recordings(path, radar=RADAR) for path in files]
    first, second = (one.recordings[0] for one in read)

    np.testing.assert_allclose(first.positions, second.positions)
    np.testing.assert_array_equal(first.rates, polar[:, 2])
    assert "bearings in degrees from north" in read[0].summary
    assert "bearings in radians from the x axis" in read[1].summary
    Track(
        files=files[:1],
        radar=TEXT,
        out=tmp_path / "out",
        picture=False,
    ).run()
    modes = np.genfromtxt(tmp_path / "out" / "estimates.csv", delimiter=",", names=True)
    assert len(modes) == len(TRUE)
    assert (
        math.hypot(
            modes["x"][-1] - first.positions[-1, 0],
            modes["y"][-1] - first.positions[-1, 1],
        )
        < 500.0
    )


def test_what_does_not_fit_a_radar_is_refused(polar, tmp_path):
    plain = write(tmp_path / "a.csv", polar[:, :2], "time,x,y")
    with pytest.raises(ArgumentError, match="no columns range and bearing"):
        read_recordings(plain, radar=RADAR)
    without = write(tmp_path / "b.csv", polar[:, :2], "time,range,bearing")
    with pytest.raises(ArgumentError, match="no column range_rate"):
        read_recordings(without, radar=RADAR)
    wrong = write(tmp_path / "c.csv", polar, "time,range,bearing,range_rate")
    wrong.write_text(wrong.read_text().replace("\n10.0,", "\n10.0,far", 1))
    with pytest.raises(ArgumentError, match=r"far.*a finite number .* or an empty cell"):
        read_recordings(wrong, radar=RADAR)
    with pytest.raises(ArgumentError, match=r"measurement_variance=1.0.*none with radar"):
        track_recording(TIMES, polar, radar=RADAR, measurement_variance=1.0)
    negative = polar.copy()
    negative[5, 0] = -3.0
    with pytest.raises(ArgumentError, match=r"positions=-3\.0"):
        track_recording(TIMES, negative, radar=RADAR)
    below = write(tmp_path / "d.csv", negative, "time,range,bearing,range_rate")
    with pytest.raises(ArgumentError, match=r"line 7: range=-3.0.*from 0 to"):
        read_recordings(below, radar=RADAR)
    with pytest.raises(ArgumentError, match=r"positions shape=.*\(n, 3\)"):
        track_recording(TIMES, polar[:, :2], radar=RADAR)


@pytest.mark.parametrize("further", ["period 5", "range 2", "range 2 period 5 at 1 1"])
def test_a_radar_of_a_recording_has_neither_period_nor_range(further, polar, tmp_path):
    path = write(tmp_path / "a.csv", polar[:, :2], "time,range,bearing [rad]")
    with pytest.raises(ArgumentError, match=r"radar='30 0.01 .*without period and range"):
        Track(files=(path,), radar=f"30 0.01 {further}").run()
    radar = parse_sensors([f"radar 30 0.01 {further}"])[0]
    with pytest.raises(ArgumentError, match=r"radar=.*no period and no range"):
        track_recording(TIMES, polar[:, :2], radar=radar)


@pytest.mark.parametrize(
    ("names", "message"),
    [
        ("time,range,bearing [mrad],range_rate", r"unit of bearing \[mrad\]='mrad'.*deg or rad"),
        ("time,range,bearing_mrad,range_rate", "unit of bearing_mrad='mrad'.*deg or rad"),
        ("time,range,bearing (mil),range_rate", "'mil'.*deg or rad"),
        ("time,range,azimuth/gon,range_rate", "'gon'.*deg or rad"),
        (
            "time,range [m],bearing,range_rate [km/h]",
            r"range_rate \[km/h\]='km/h'.*m/s, as of the range",
        ),
    ],
)
def test_other_units_of_a_radar_are_refused(names, message, polar, tmp_path):
    with pytest.raises(ArgumentError, match=message):
        read_recordings(write(tmp_path / "a.csv", polar, names), radar=RADAR)


def test_a_bearing_error_that_bends_too_much_is_said(polar):
    plain = track_recording(
        TIMES,
        polar[:, :2],
        radar=Radar(range_deviation=30.0, bearing_deviation=0.015, position=RADAR.position),
        radii=(RADIUS,),
    )
    bent = track_recording(
        TIMES,
        polar[:, :2],
        radar=Radar(range_deviation=30.0, bearing_deviation=0.06, position=RADAR.position),
        radii=(RADIUS,),
    )

    assert not any("bearing error" in text for text in plain.warnings)
    assert any("bearing error is too large" in text for text in bent.warnings)
