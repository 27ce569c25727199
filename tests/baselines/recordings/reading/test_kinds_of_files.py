"""One file of each kind: what wrote it is pandas, a spreadsheet, a GPS watch, NumPy."""

import gzip
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from baselines.recordings.reading.read import read_recordings
from hybrid_env.checks import ArgumentError

ROWS = 40
GENERATOR = np.random.default_rng(0)
TIMES = 0.25 * np.arange(ROWS)
X, Y = np.cumsum(GENERATOR.normal(0.3, 0.1, (2, ROWS)), axis=1)
FRAME = pd.DataFrame({"t": TIMES, "x": X, "y": Y})
DATES = pd.date_range("2024-05-01T10:00:00", periods=ROWS, freq="250ms")


def check(path: Path, times: np.ndarray | None = TIMES, **options) -> str:
    file = read_recordings(path, **options)
    [recording] = file.recordings
    np.testing.assert_array_equal(recording.positions, np.column_stack([X, Y]))
    np.testing.assert_allclose(recording.times, np.arange(ROWS) if times is None else times, atol=1e-9)
    assert recording.time_unit == ("ticks" if times is None else "s")
    assert recording.pieces == ((0, ROWS),)
    assert recording.name == "walk"
    assert "\n" not in file.summary
    assert f"{ROWS} rows; 1 object; " in file.summary
    return file.summary


@pytest.mark.parametrize("compressed", ["", ".gz"])
@pytest.mark.parametrize("index", [False, True])
@pytest.mark.parametrize(("ending", "separator"), [("csv", ","), ("tsv", "\t"), ("csv", ";"), ("txt", "|")])
def test_what_pandas_writes(tmp_path, ending, separator, index, compressed):
    path = tmp_path / f"walk.{ending}{compressed}"
    FRAME.to_csv(path, sep=separator, index=index)
    assert ("index column not used" in check(path)) == index


def test_times_in_the_index_of_pandas(tmp_path):
    path = tmp_path / "walk.csv"
    FRAME.set_index("t").to_csv(path)
    check(path)
    FRAME[["x", "y"]].set_index(DATES).to_csv(path)  # the index has no name
    assert "dates from 2024-05-01T10:00:00Z" in check(path)
    FRAME[["x", "y"]].set_index(pd.Index(TIMES)).to_csv(path)
    with pytest.raises(
        ArgumentError, match=r"column 1 is no number of the row.*--columns, .* time=1 x=\.\.\."
    ):
        read_recordings(path)
    check(path, columns={"time": "1", "x": "x", "y": "y"})


def test_without_times_the_index_or_the_rows_are_ticks(tmp_path):
    path = tmp_path / "walk.csv"
    FRAME[["x", "y"]].to_csv(path)
    assert "index column taken as ticks" in check(path, times=None)
    FRAME[["x", "y"]].to_csv(path, index=False)
    assert "no times: a row is a tick (--tau)" in check(path, times=None)
    check(path, times=TIMES, tau=0.25)
    FRAME[["x", "y"]].drop(index=range(5, 8)).to_csv(path)
    [recording] = read_recordings(path, tau=0.25).recordings
    np.testing.assert_allclose(recording.times, np.delete(TIMES, range(5, 8)))


def test_without_header(tmp_path):
    path = tmp_path / "walk.csv"
    FRAME.to_csv(path, header=False, index=False)
    assert "no header: columns taken as time, x, y" in check(path)
    FRAME[["x", "y"]].to_csv(path, header=False, index=False)
    assert "no header: columns taken as x, y" in check(path, times=None)
    FRAME.to_csv(path, header=False)
    with pytest.raises(ArgumentError, match=r"4 columns without names.*--columns time=1 x=2 y=3"):
        read_recordings(path)
    check(path, columns={"t": "2", "x": "3", "y": "4"})


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "cp1252"])
@pytest.mark.parametrize("end", ["\r\n", "\n", "\r"])
def test_export_of_a_spreadsheet(tmp_path, encoding, end):
    path = tmp_path / "walk.csv"
    frame = FRAME.rename(columns={"t": "Time (s)", "x": "X [km]", "y": "Y [km]"}).assign(Höhe="tief")
    text = frame.to_csv(sep=";", decimal=",", lineterminator=end) + f";;;;{end}" * 3
    path.write_bytes(("sep=;" + end + text).encode(encoding))
    summary = check(path)
    assert " km; " in summary
    assert "decimal comma" in summary
    assert "3 empty rows at the end left out" in summary
    assert "columns not used: Höhe" in summary
    assert ("Windows-1252" in summary) == (encoding == "cp1252")


def test_quoted_decimal_commas_between_commas(tmp_path):
    path = tmp_path / "walk.csv"
    cells = FRAME.map(lambda value: str(value).replace(".", ","))
    cells.to_csv(path, quoting=1, index=False)
    assert "decimal comma" in check(path)


def test_parquet(tmp_path):
    path = tmp_path / "walk.parquet"
    FRAME.to_parquet(path)
    check(path)
    FRAME.assign(t=DATES).set_index("t").to_parquet(path)
    assert "dates" in check(path)
    FRAME[["x", "y"]].set_index(DATES.tz_localize("UTC")).to_parquet(path)
    assert "dates" in check(path)
    path.write_bytes(gzip.compress(path.read_bytes()))
    check(path)
    FRAME.astype({"x": "Float64", "y": "float32"}).to_parquet(path)
    [recording] = read_recordings(path).recordings
    np.testing.assert_array_equal(recording.positions[:, 0], X)
    FRAME.head(0).to_parquet(path)
    with pytest.raises(ArgumentError, match="not an empty table"):
        read_recordings(path)


@pytest.mark.parametrize("header", ["", "t x y", "t, x, y\nmade by NumPy"])
@pytest.mark.parametrize("delimiter", [" ", ",", "\t"])
def test_what_numpy_writes(tmp_path, header, delimiter):
    path = tmp_path / "walk.txt"
    lines = header.split("\n")
    np.savetxt(path, FRAME, header="\n".join(lines[::-1]).replace(", ", delimiter), delimiter=delimiter)
    assert ("1 line before the header left out" in check(path)) == (len(lines) > 1)


def test_columns_that_are_aligned_by_spaces(tmp_path):
    path = tmp_path / "walk.txt"
    path.write_text(FRAME.map(repr).to_string())
    check(path)
    path.write_text(FRAME.map(repr).to_string(index=False, header=False) + "\n")
    check(path)


def test_a_delimiter_at_the_end_of_each_row(tmp_path):
    path = tmp_path / "walk.csv"
    path.write_text(FRAME.to_csv(index=False).replace("\n", ",\n"))
    check(path)
    path.write_text(FRAME.to_csv(index=False).replace("\n", ",\n").replace("y,", "y", 1))
    check(path)


GPX = """<?xml version="1.0" encoding="UTF-8"?>
<gpx creator="watch" version="1.1" xmlns="http://www.topografix.com/GPX/1/1" xmlns:ns3="http://x.org/e">
 <metadata><time>2024-05-01T10:00:00.000Z</time></metadata>
 <trk><name>Morning run</name><type>running</type>{segments}</trk>
</gpx>"""
POINT = (
    '<trkpt lat="{:.7f}" lon="{:.7f}"><ele>12.4</ele>{}<extensions><ns3:TrackPointExtension><ns3:hr>91'
    "</ns3:hr></ns3:TrackPointExtension></extensions></trkpt>"
)


def points(rows, times=True):
    time = "<time>2024-05-01T10:00:{:02d}Z</time>"
    return "".join(
        POINT.format(55.75 + 2e-5 * k, 37.6 + 1e-5 * k, time.format(k) if times else "") for k in rows
    )


def test_gpx_of_a_watch(tmp_path):
    path = tmp_path / "activity.gpx"
    segments = f"<trkseg>{points(range(20))}</trkseg><trkseg>{points(range(25, 40))}</trkseg>"
    path.write_text(GPX.format(segments=segments))
    file = read_recordings(path)
    [recording] = file.recordings
    assert (recording.name, recording.unit, recording.epoch) == ("Morning run", "m", "2024-05-01T10:00:00Z")
    assert recording.pieces == ((0, 20), (20, 35))  # a segment begins where reception was lost
    np.testing.assert_array_equal(recording.times, [*range(20), *range(25, 40)])
    steps = np.diff(recording.positions[:20], axis=0)
    np.testing.assert_allclose(steps, [[0.628, 2.227]] * 19, rtol=2e-3)
    assert "degrees projected to metres around 55.75" in file.summary
    path.write_bytes(b"\xef\xbb\xbf" + gzip.compress(b"")[:0] + path.read_bytes())
    assert len(read_recordings(path).recordings[0].times) == 35


def test_gpx_without_times_and_with_two_tracks(tmp_path):
    path = tmp_path / "activity.gpx"
    segments = f"<trkseg>{points(range(20), times=False)}</trkseg>"
    path.write_text(GPX.format(segments=segments))
    assert read_recordings(path, tau=2.0).recordings[0].tick == 2.0
    two = f"<trkseg>{points(range(20))}</trkseg></trk><trk><trkseg>{points(range(9))}</trkseg>"
    path.write_text(GPX.format(segments=two))
    file = read_recordings(path)
    assert [(one.name, len(one.times)) for one in file.recordings] == [("Morning run", 20), ("track 2", 9)]
    path.write_text(GPX.format(segments=""))
    with pytest.raises(ArgumentError, match="GPX file with track points"):
        read_recordings(path)
