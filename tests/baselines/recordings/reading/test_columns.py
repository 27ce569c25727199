"""Which column holds what: names, units, objects, and what the caller says."""

import numpy as np
import pandas as pd
import pytest

from baselines.recordings.reading.names import ROLES, role_of, split_unit
from baselines.recordings.reading.read import read_recordings
from hybrid_env.checks import ArgumentError

ROWS = 30
T = np.arange(ROWS, dtype=np.float64)
FRAME = pd.DataFrame({"t": T, "x": 1.5 * T, "y": np.sqrt(T)})


@pytest.fixture
def read(tmp_path):
    def read(frame, name="walk.csv", **options):
        if isinstance(frame, str):
            (tmp_path / name).write_text(frame)
        else:
            frame.to_csv(tmp_path / name, index=False)
        return read_recordings(tmp_path / name, **options)

    return read


def one(file):
    [recording] = file.recordings
    return recording


@pytest.mark.parametrize(
    ("header", "name", "unit"),
    [
        ("x", "x", None), (" X [m] ", "x", "m"), ("Easting (km)", "easting", "km"), ("pos_x", "pos_x", None),
        ("x_km", "x", "km"), ("t/s", "t", "s"), ("time_ms", "time", "ms"), ("x_pos", "x_pos", None),
        ("GPS Latitude", "gps_latitude", None), ("x [px]", "x", "px"), ("x []", "x", None), ("m", "m", None),
        ("location-long", "location_long", None), ("_ms", "ms", None), ("", "", None),
    ],
)  # fmt: skip
def test_name_and_unit_of_a_header(header, name, unit):
    assert split_unit(header) == (name, unit)


def test_a_name_has_one_role():
    names = [name for names in ROLES.values() for name in names]
    assert len(names) == len(set(names))
    assert {role_of(name.upper()) for name in ROLES["lat"]} == {"lat"}
    assert role_of("estimate_x") is None


@pytest.mark.parametrize("names", [("Time", "Easting", "Northing"), ("timestamp", "pos_x", "pos_y")])
def test_columns_are_found_by_name_in_any_order(read, names):
    frame = FRAME.set_axis(names, axis=1)[[names[2], names[0], names[1]]].assign(speed=1.0)
    file = read(frame)
    np.testing.assert_array_equal(one(file).positions, FRAME[["x", "y"]])
    np.testing.assert_array_equal(one(file).times, T)
    assert "columns not used: speed" in file.summary


def test_columns_of_the_caller(read):
    frame = FRAME.set_axis(["Zeit", "Ost", "Nord"], axis=1)
    with pytest.raises(ArgumentError, match=r"its columns are Zeit, Ost, Nord\): name them by --columns"):
        read(frame)
    for columns in ({"t": "zeit", "x": "Ost", "y": "NORD"}, {"time": "1", "x": "2", "y": "3"}):
        np.testing.assert_array_equal(one(read(frame, columns=columns)).times, T)
    recording = one(read(FRAME.assign(u=T, v=T), columns={"x": "v", "y": "u"}))
    np.testing.assert_array_equal(recording.positions, np.column_stack([T, T]))
    np.testing.assert_array_equal(recording.times, T)


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"x": "Ost", "y": "y"}, "columns='Ost'.*walk.csv, by name or number: its columns are t, x, y"),
        ({"x": "0", "y": "4"}, "columns='0'"),
        ({"x": "x"}, "columns={'x': 'x'}.*x and y, or lat and lon"),
        ({"z": "x"}, "columns='z'.*time, x, y, lat, lon"),
    ],
)
def test_wrong_columns_of_the_caller(read, columns, message):
    with pytest.raises(ArgumentError, match=message):
        read(FRAME, columns=columns)


def test_two_columns_for_one_role_are_refused(read):
    with pytest.raises(ArgumentError, match="both 't' and 'timestamp' may be time: choose by --columns"):
        read(FRAME.assign(timestamp=1e9))
    with pytest.raises(ArgumentError, match=r"x, y and lat, lon: choose by --columns.*lat=lat lon=lon"):
        read(FRAME.assign(lat=T / 1e5, lon=T / 1e5))
    with pytest.raises(ArgumentError, match=r"columns='x'.*several columns have this name"):
        read("t,x,X,y\n0,1,1,1\n1,2,2,2\n", columns={"x": "x", "y": "y"})
    read("t,x,X,y\n0,1,1,1\n1,2,2,2\n", columns={"x": "3", "y": "4"})


def test_units(read):
    assert one(read(FRAME)).unit == "units"
    assert one(read(FRAME, unit="furlong")).unit == "furlong"
    assert one(read(FRAME.rename(columns={"x": "x_ft", "y": "y_ft"}))).unit == "ft"
    mixed = FRAME.rename(columns={"x": "x_ft", "y": "y_m"})
    with pytest.raises(ArgumentError, match=r"'x_ft' and 'y_m' have different units.*--unit"):
        read(mixed)
    assert one(read(mixed, unit="m")).unit == "m"


TWO = pd.concat([FRAME.assign(who="b"), FRAME.assign(who="a", x=FRAME.x + 50.0)], ignore_index=True)


@pytest.mark.parametrize("name", ["id", "Object", "MMSI", "individual-local-identifier"])
@pytest.mark.parametrize("order", ["who", "t"])
def test_objects_are_found_by_the_name_of_their_column(read, name, order):
    file = read(TWO.sort_values(order, kind="stable").rename(columns={"who": name}))
    assert f"60 rows; 2 objects by '{name}'" in file.summary
    found = {recording.name: recording for recording in file.recordings}
    assert set(found) == {"a", "b"}
    np.testing.assert_array_equal(found["a"].positions[:, 0], FRAME.x + 50.0)
    np.testing.assert_array_equal(found["b"].times, T)


def test_objects_of_the_caller(read):
    with pytest.raises(ArgumentError, match=r"line 32: t='0.0'.*after 29.0.*--object"):
        read(TWO)
    assert [one.name for one in read(TWO, object_column="who").recordings] == ["b", "a"]
    numbers = TWO.assign(who=(TWO.who == "a") + 7.0)
    assert [one.name for one in read(numbers, object_column="4").recordings] == ["7", "8"]
    with pytest.raises(ArgumentError, match=r"object='whom'.*its columns are t, x, y, who"):
        read(TWO, object_column="whom")
    with pytest.raises(ArgumentError, match=r"line 3: who: the cell is empty: expected an object.*--object"):
        read("t,x,y,who\n0,1,2,a\n1,2,3,\n", object_column="who")
    with pytest.raises(ArgumentError, match=r"line 4: t='1'.*after 1 of object a"):
        read("t,x,y,who\n0,1,2,a\n1,2,3,a\n1,2,3,a\n", object_column="who")


def test_one_object(read):
    assert one(read(FRAME.assign(id="car"))).name == "car"
    assert one(read(FRAME.assign(id=7))).name == "7"
    assert one(read(FRAME.assign(id=range(ROWS)))).name == "walk"  # a number of the row
    assert one(read(FRAME.assign(id=["a", "b"] * 15), object_column="none")).name == "walk"


def test_two_columns_that_tell_objects_apart_differently(read):
    frame = TWO.rename(columns={"who": "icao24"}).assign(callsign=["u", "v", "w"] * 20)
    with pytest.raises(ArgumentError, match=r"'icao24' and 'callsign' tell objects apart.*--object"):
        read(frame)
    assert len(read(frame, object_column="icao24").recordings) == 2


def test_an_object_with_a_single_row_is_left_out_with_a_word(read):
    file = read(pd.concat([TWO, FRAME.head(1).assign(who="c")]), object_column="who")
    assert "2 objects by 'who'" in file.summary
    assert "1 object with fewer than two measurements left out" in file.summary
    with pytest.raises(ArgumentError, match="no object has two measured positions"):
        read(TWO.groupby("who").head(1), object_column="who")


def test_unmarked_objects_without_a_word_in_the_times(read):
    advice = "--object, or --object none"
    far = TWO.assign(x=TWO.x + 1000.0 * (TWO.who == "a"))
    with pytest.raises(ArgumentError, match=rf"a jump of 1006.5.*{advice}"):
        read(far[["x", "y"]])  # one after the other
    interleaved = TWO.sort_values("t", kind="stable").assign(t=np.arange(2.0 * ROWS))[["t", "x", "y"]]
    noise = np.random.default_rng(0).normal(0.0, 0.5, (2 * ROWS, 2))
    interleaved[["x", "y"]] += noise
    with pytest.raises(ArgumentError, match=rf"rows alternate between places.*{advice}"):
        read(interleaved)
    assert len(one(read(interleaved, object_column="none")).times) == 2 * ROWS


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e6])
@pytest.mark.parametrize("step", [0.0, 0.1, 3.0])
def test_one_object_is_not_taken_for_two(read, step, scale):
    generator = np.random.default_rng(1)
    rows = 300
    heading = np.cumsum(generator.normal(0.0, 0.3, rows))
    track = step * np.cumsum(np.column_stack([np.cos(heading), np.sin(heading)]), axis=0)
    track += generator.normal(0.0, 1.0, (rows, 2))
    track[::50] += 100.0  # outliers
    track[150:] += 2.0 * step  # lost rows
    positions = scale * (track + 1000.0)
    frame = pd.DataFrame({"t": np.arange(rows), "x": positions[:, 0], "y": positions[:, 1]})
    assert len(one(read(frame, unit="km")).times) == rows
    coarse = frame.assign(x=10.0 * scale * np.round(track[:, 0] / 10.0), y=0.0)  # mostly equal positions
    assert len(one(read(coarse, unit="km")).times) == rows
