"""One file of each kind: what wrote it is pandas, a spreadsheet, a GPS watch, NumPy."""

import gzip
import io

import numpy as np
import pandas as pd
import pytest
from hostile_input import profile
from hypothesis import given
from hypothesis import strategies as st

from hybrid_env.checks import ArgumentError

ROWS = 40
TIMES = 0.25 * np.arange(ROWS)
X, Y = np.cumsum(np.random.default_rng(0).normal(0.3, 0.1, (2, ROWS)), axis=1)
FRAME = pd.DataFrame({"t": TIMES, "x": X, "y": Y})
PLANE = FRAME[["x", "y"]]
DATES = pd.date_range("2024-05-01T10:00:00", periods=ROWS, freq="250ms")
TEXT = FRAME.map(repr)


@pytest.fixture
def check(read):
    """Return a function that reads `FRAME` from a file and returns the summary."""

    def check(content, times=TIMES, **options):
        file = read(content, **options)
        [recording] = file.recordings
        np.testing.assert_array_equal(recording.positions, PLANE)
        np.testing.assert_allclose(
            recording.times, np.arange(ROWS) if times is None else times, atol=1e-9
        )
        assert recording.time_unit == ("ticks" if times is None else "s")
        assert recording.pieces == ((0, ROWS),)
        assert recording.name == "walk"
        assert "\n" not in file.summary
        assert f"{ROWS} rows; 1 object; " in file.summary
        return file.summary

    return check


def parquet(frame):
    return frame.to_parquet()


@pytest.mark.parametrize(
    ("content", "options", "said"),
    [
        # The index has no name.
        (PLANE.set_index(DATES).to_csv(), {}, "dates from 2024-05-01T10:00:00Z"),
        (PLANE.to_csv(), {"times": None}, "'column 1' taken as ticks"),
        (PLANE, {"times": None}, "no times: a row is a tick (--tau)"),
        (PLANE, {"tau": 0.25}, "tick 0.25 s"),
        (
            PLANE.to_csv(header=False, index=False),
            {"times": None},
            "no header: columns taken as x, y",
        ),
        (FRAME.to_csv(header=False), {"columns": {"t": "2", "x": "3", "y": "4"}}, ""),
        (
            FRAME.map(lambda value: str(value).replace(".", ",")).to_csv(quoting=1),
            {},
            "decimal comma",
        ),
        # Aligned by spaces.
        (TEXT.to_string(), {"name": "walk.txt"}, ""),
        # A delimiter at the end of each row.
        (FRAME.to_csv(index=False).replace("\n", ",\n"), {}, ""),
        (FRAME.to_csv(index=False).replace("\n", ",\n").replace("y,", "y", 1), {}, ""),
        (gzip.compress(parquet(FRAME)), {"name": "walk.parquet"}, ""),
        (parquet(FRAME.assign(t=DATES).set_index("t")), {"name": "walk.parquet"}, "dates"),
        (parquet(PLANE.set_index(DATES.tz_localize("UTC"))), {"name": "walk.parquet"}, "dates"),
    ],
    ids=range(13),
)
def test_times_header_and_index(check, content, options, said):
    assert said in check(content, **options)


@pytest.mark.parametrize(
    ("encoding", "end"), [("utf-8-sig", "\r\n"), ("utf-16", "\n"), ("cp1252", "\r")]
)
def test_export_of_a_spreadsheet(check, encoding, end):
    frame = FRAME.rename(columns={"t": "Time (s)", "x": "X [km]", "y": "Y [km]"}).assign(
        Höhe="tief"
    )
    text = frame.to_csv(sep=";", decimal=",", lineterminator=end) + f";;;;{end}" * 3
    summary = check(("sep=;" + end + text).encode(encoding))
    for said in (" km; ", "decimal comma", "blank lines (3)", "columns not used: Höhe"):
        assert said in summary

    assert ("Windows-1252" in summary) == (encoding == "cp1252")


@pytest.mark.parametrize("header", ["", "t x y", "t, x, y\nmade by NumPy"])
@pytest.mark.parametrize("delimiter", [" ", ",", "\t"])
def test_what_numpy_writes(check, header, delimiter):
    lines = header.split("\n")
    stream = io.StringIO()
    np.savetxt(
        stream, FRAME, header="\n".join(lines[::-1]).replace(", ", delimiter), delimiter=delimiter
    )
    summary = check(stream.getvalue(), name="walk.txt")

    assert ("headers and comments (1)" in summary) == (len(lines) > 1)


GPX = """<?xml version="1.0" encoding="UTF-8"?>
<gpx creator="watch" version="1.1" xmlns="http://www.topografix.com/GPX/1/1" xmlns:ns3="http://x.org/e">
 <metadata><time>2024-05-01T10:00:00.000Z</time></metadata>
 <trk><name>Morning run</name><type>running</type>{}</trk>
</gpx>"""
POINT = (
    '<trkpt lat="{:.7f}"'
    ' lon="{:.7f}"><ele>12.4</ele>{}<extensions><ns3:TrackPointExtension><ns3:hr>91'
    "</ns3:hr></ns3:TrackPointExtension></extensions></trkpt>"
)


def segment(rows, times=True):
    time = "<time>2024-05-01T10:00:{:02d}Z</time>" if times else ""
    points = [POINT.format(55.75 + 2e-5 * k, 37.6 + 1e-5 * k, time.format(k)) for k in rows]
    return f"<trkseg>{''.join(points)}</trkseg>"


def test_gpx_of_a_watch(read, read_one):
    content = GPX.format(segment(range(20)) + segment(range(25, 40)))
    file = read(content)
    [recording] = file.recordings

    assert (recording.name, recording.unit, recording.epoch) == (
        "Morning run",
        "m",
        "2024-05-01T10:00:00Z",
    )
    # A segment begins where reception was lost.
    assert recording.pieces == ((0, 20), (20, 35))
    np.testing.assert_array_equal(recording.times, [*range(20), *range(25, 40)])
    steps = np.diff(recording.positions[:20], axis=0)
    np.testing.assert_allclose(steps, [[0.628, 2.227]] * 19, rtol=2e-3)
    assert "degrees projected to metres around 55.75" in file.summary
    assert len(read_one(b"\xef\xbb\xbf" + content.encode()).times) == 35


def test_gpx_without_times_and_with_two_tracks(read, read_one):
    assert read_one(GPX.format(segment(range(20), times=False)), tau=2.0).tick == 2.0
    two = read(GPX.format(f"{segment(range(20))}</trk><trk>{segment(range(9))}"))
    assert [(one.name, len(one.times)) for one in two.recordings] == [
        ("Morning run", 20),
        ("track 2", 9),
    ]
    with pytest.raises(ArgumentError, match="XML without points of a track of GPX"):
        read(GPX.format(""))


NUMBERS = st.floats(-1e9, 1e9, allow_subnormal=False) | st.integers(-1000, 1000).map(float)
CELLS = NUMBERS | st.just(float("nan"))


@st.composite
def frames(draw):
    """Rows of increasing times and positions with missing ones; at least two are measured."""
    rows = draw(st.integers(2, 12))
    times = sorted(
        draw(st.sets(st.floats(-1e5, 1e5, allow_subnormal=False), min_size=rows, max_size=rows))
    )
    cells = draw(st.lists(st.tuples(CELLS, CELLS), min_size=rows, max_size=rows))
    positions = np.array([*draw(st.tuples(*[st.tuples(NUMBERS, NUMBERS)] * 2)), *cells][:rows])
    return pd.DataFrame(
        {"time": times, "x": positions[:, 0], "y": positions[:, 1], "note": "a b, c; d\te|f '\""}
    )


@pytest.mark.parametrize("examples", [60, pytest.param(5_000, marks=pytest.mark.study)])
def test_what_pandas_writes_is_read_bit_for_bit(read_one, examples):
    @profile(examples)
    @given(
        frames(),
        st.sampled_from([(",", "."), ("\t", "."), (";", "."), (";", ","), ("\t", ","), ("|", ".")]),
        st.booleans(),
        st.sampled_from(["utf-8", "utf-8-sig", "utf-16"]),
        st.sampled_from(["\n", "\r\n"]),
        st.permutations(["time", "x", "y", "note"]),
        st.sampled_from(["csv", "csv", "parquet"]),
    )
    def check(frame, marks, index, encoding, end, order, kind):
        content = parquet(frame[order])
        if kind == "csv":
            text = frame[order].to_csv(
                sep=marks[0], decimal=marks[1], index=index, lineterminator=end
            )
            content = text.encode(encoding)
        recording = read_one(content, object_column="none", unit="m")
        expected = frame[["x", "y"]].to_numpy(copy=True)
        expected[np.isnan(expected).any(axis=1)] = np.nan
        np.testing.assert_array_equal(recording.positions, expected)
        np.testing.assert_array_equal(recording.times, frame["time"])
        measured = [row for first, last in recording.pieces for row in range(first, last)]
        assert set(np.flatnonzero(recording.measured)) <= set(measured)

    check()
