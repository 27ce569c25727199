"""Which column holds what: names, units, objects, and what the caller says."""

import numpy as np
import pandas as pd
import pytest
from recorded_tracks import directions

from hybrid_env.checks import ArgumentError

ROWS = 30
T = np.arange(ROWS, dtype=np.float64)
FRAME = pd.DataFrame({"t": T, "x": 1.5 * T, "y": np.sqrt(T)})
TWO = pd.concat([FRAME.assign(who="b"), FRAME.assign(who="a", x=FRAME.x + 50.0)], ignore_index=True)
TWO_NAMED = TWO.rename(columns={"who": "icao24"}).assign(callsign=["u", "v", "w"] * 20)
OTHER = FRAME.set_axis(["Zeit", "Ost", "Nord"], axis=1)
FEET = FRAME.rename(columns={"x": "x_ft", "y": "y_ft"})
MIXED = FRAME.rename(columns={"x": "x_ft", "y": "y_m"})


@pytest.mark.parametrize(
    ("frame", "columns", "expected"),
    [
        (OTHER, {"t": "zeit", "x": "Ost", "y": "NORD"}, FRAME[["x", "y"]]),
        (OTHER, {"time": "1", "x": "2", "y": "3"}, FRAME[["x", "y"]]),
        (FRAME.assign(u=T, v=T), {"x": "v", "y": "u"}, np.column_stack([T, T])),
    ],
)
def test_columns_of_the_caller(read_one, frame, columns, expected):
    recording = read_one(frame, columns=columns)
    np.testing.assert_array_equal(recording.times, T)
    np.testing.assert_array_equal(recording.positions, expected)


def test_units(read_one):
    assert read_one(FRAME).unit == "units"
    assert read_one(FRAME, unit="furlong").unit == "furlong"
    assert read_one(FEET).unit == "ft"
    assert read_one(MIXED, unit="m").unit == "m"
    with pytest.raises(ArgumentError, match="positions in ft and m: expected one, or --unit"):
        read_one(MIXED)
    with pytest.raises(ArgumentError, match=r"unit='km' .*latitudes and longitudes"):
        read_one(FRAME.set_axis(["t", "lat", "lon"], axis=1), unit="km")


@pytest.mark.parametrize(
    ("frame", "column", "names"),
    [
        (TWO, "who", ["b", "a"]),
        (TWO.assign(who=(TWO.who == "a") + 7.0), "4", ["7", "8"]),
        (TWO_NAMED, "icao24", ["b", "a"]),
        (FRAME.assign(id="car"), None, ["car"]),
        # A number of the row.
        (FRAME.assign(id=range(ROWS)), None, ["walk"]),
        (FRAME.assign(id=["a", "b"] * 15), "none", ["walk"]),
    ],
)
def test_names_of_objects(read, frame, column, names):
    assert [one.name for one in read(frame, object_column=column).recordings] == names


@pytest.mark.parametrize(("scale", "step"), [(1e-3, 0.0), (1.0, 0.1), (1e6, 3.0)])
def test_one_object_is_not_taken_for_two(read_one, step, scale):
    generator = np.random.default_rng(1)
    rows = 300
    heading = np.cumsum(generator.normal(0.0, 0.3, rows))
    track = step * np.cumsum(directions(heading), axis=0)
    track += generator.normal(0.0, 1.0, (rows, 2))
    # Errors of the sensor.
    track[::20] += 30.0
    # Lost rows.
    track[150:] += 2.0 * step
    x, y = (scale * (track + 1000.0)).T
    frame = pd.DataFrame({"t": np.arange(rows), "x": x, "y": y})

    assert len(read_one(frame, unit="km").times) == rows
    # Mostly equal positions.
    coarse = frame.assign(x=10.0 * scale * np.round(track[:, 0] / 10.0), y=0.0)
    assert len(read_one(coarse, unit="km").times) == rows
