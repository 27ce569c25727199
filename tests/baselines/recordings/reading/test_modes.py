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
        ("t,whatever\n0,left\n0.5,\n1,right\n", {}),
        ("a,b\n0,left\n0.5,\n1,right\n", {"columns": {"time": "1", "mode": "b"}}),
        ("a,b\n0,left\n500,\n1000,right\n", {"columns": {"time": "a"}, "time_unit": "ms"}),
        ("t,object,mode\n0,p,left\n0.5,p,\n1,p,right\n", {"object_column": "none"}),
    ],
)
def test_times_and_modes_of_one_track(read, text, options):
    found = read(text, **options)
    (times,), (modes,) = (list(one.values()) for one in found)

    np.testing.assert_allclose(times, [0.0, 0.5, 1.0])
    assert modes == ["left", None, "right"]


def test_tracks_and_dates(read):
    text = (
        "track,date,state\n"
        "b,2026-01-01T00:00:01,0\n"
        "a,2026-01-01T00:00:00,1\n"
        "b,2026-01-01T00:00:02,2\n"
    )
    found = read(text)

    assert found.modes == {"b": ["0", "2"], "a": ["1"]}
    assert (
        found.times["b"].tolist()
        == np.array(["2026-01-01T00:00:01", "2026-01-01T00:00:02"], "M8[ns]").tolist()
    )
    other = read("track,date,state\na,2026-01-01T00:00:00,1\nb,2026-01-01T00:00:01,0\n")
    assert list(other.like(found, "x").times) == ["b", "a"]
    with pytest.raises(ArgumentError, match=r"tracks of x=.*also a"):
        read("track,date,state\nc,2026-01-01,1\nb,2026-01-02,0\n").like(found, "x")


@pytest.mark.parametrize(
    ("text", "options", "message"),
    [
        (
            "x,mode\n0,1\n1,2\n",
            {},
            r"no column of times \(its columns are x, mode\): name it by --columns",
        ),
        ("t,time,mode\n0,1,1\n1,2,2\n", {}, "both 't' and 'time' may be it"),
        ("t,u,v\n0,1,1\n1,2,2\n", {}, r"no column of modes \(its columns are t, u, v\)"),
        ("t,mode\n0,1\n0,2\n", {}, "line 3: t='0'.*a time after 0"),
        ("t,mode\n0,1\nx,2\n1,2\n", {}, "t='x'"),
        ("t,mode\n0,1\n1,2\n", {"columns": {"x": "1"}}, "columns='x'.*time, mode"),
        ("t,mode\n0,1\n1,2\n", {"object_column": "who"}, "object='who'.*a column of"),
    ],
)
def test_errors_name_file_and_remedy(read, text, options, message):
    with pytest.raises(ArgumentError, match=message) as raised:
        read(text, **options)
    assert "\n" not in str(raised.value)
