"""Files of modes over time: columns, tracks, dates, and errors of one line."""

import numpy as np
import pytest

from baselines.recordings.reading.modes import read_modes
from hybrid_env.checks import ArgumentError


@pytest.fixture
def read(tmp_path):
    def read(text, **options):
        (tmp_path / "modes.csv").write_text(text)
        return read_modes(tmp_path / "modes.csv", **options)

    return read


@pytest.mark.parametrize(
    ("text", "options"),
    [
        ("t,mode\n0,left\n0.5,\n1,right\n", {}),
        ("time [ms];x;stated\n0;7;left\n500;7;\n1000;8;right\n", {}),
        ("a,b\n0,left\n0.5,\n1,right\n", {"columns": {"time": "1", "mode": "b"}}),
        (
            "a,b\n0,left\n500,\n1000,right\n",
            {"columns": {"time": "a", "mode": "2"}, "time_unit": "ms"},
        ),
        ("t,object,mode\n0,p,left\n0.5,p,\n1,p,right\n", {"object_column": "none"}),
    ],
)
def test_times_and_modes_of_one_track(read, text, options):
    file = read(text, **options)
    (times,), (modes,) = (list(one.values()) for one in file)

    np.testing.assert_allclose(times, [0.0, 0.5, 1.0])
    assert modes == ["left", None, "right"]


def test_tracks_and_dates(read):
    text = (
        "track,date,state\n"
        "b,2026-01-01T00:00:01,0\n"
        "a,2026-01-01T00:00:00,1\n"
        "b,2026-01-01T00:00:02,2\n"
    )
    file = read(text)

    assert file.modes == {"b": ["0", "2"], "a": ["1"]}
    assert (
        file.times["b"].tolist()
        == np.array(["2026-01-01T00:00:01", "2026-01-01T00:00:02"], "M8[ns]").tolist()
    )
    other = read("track,date,state\na,2026-01-01T00:00:00,1\nb,2026-01-01T00:00:01,0\n")
    assert list(other.like(file, "x").times) == ["b", "a"]
    with pytest.raises(ArgumentError, match=r"tracks of x=.*also a"):
        read("track,date,state\nc,2026-01-01,1\nb,2026-01-02,0\n").like(file, "x")


def test_rows_that_are_sorted_or_without_a_time_are_said(read):
    with pytest.warns(UserWarning, match=r"modes\.csv: .*sorted: 1.*rows without a time \(2\)"):
        file = read("t,mode\n0,a\n1,b\n3,d\n2,c\nnan,x\n,y\n4,e\n")
    assert file.modes == {"modes": [*"abcde"]}


def test_columns_that_are_not_clear_are_refused(read):
    with pytest.raises(ArgumentError, match=r"no columns mode .*--columns time=1 mode=2"):
        read("t,whatever\n0,left\n1,right\n")
    with pytest.raises(ArgumentError, match=r"no column of times .*--columns, as time=1"):
        read("whatever,mode\n0,left\n1,right\n")
    with pytest.warns(
        UserWarning, match=r"'state' \(column 2\) taken as mode, not 'mode' \(column 3"
    ):
        read("t,state,mode\n0,a,left\n1,b,right\n")
