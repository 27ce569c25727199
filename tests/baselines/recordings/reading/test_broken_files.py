"""Files that are damaged, very large, or no recordings: one line each."""

import gzip
import os
import tracemalloc

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet
import pytest
from hostile_input import accepted, attack, damaged

from baselines.recordings.reading import files
from baselines.recordings.reading.read import read_recordings
from hybrid_env.checks import ArgumentError

STUDY = pytest.param(3_000, marks=pytest.mark.study)
ROWS = "".join(f"{k / 10},{k * 0.2:.3f},{(k % 7) * 0.1:.3f}\n" for k in range(30))
FRAME = pd.DataFrame({"t": np.arange(30.0), "x": np.arange(30.0), "y": np.sqrt(np.arange(30.0))})
PARQUET, ZIPPED = FRAME.to_parquet(), gzip.compress(ROWS.encode(), mtime=0)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "not an empty file"),
        ("x,y\n1,two\n2,three\n3,4\n", "y='two'"),
        ("t,x,z\n1,2,3\n", "its columns are t, x, z.*--columns"),
        ("t,x,y\n3,1,2\n", "1 measured position"),
        ("t,x,y\nnoon,1,2\nnight,1,2\n", "t='noon'.*--time-unit"),
        ("t,x,y\n024-05-01,1,2\n2024-05-01,1,2\n", "1 measured position"),
        (b"\xff\xfex,y\n1", "UTF-16"),
        (b"x,y\n1,\x002\n", "file in UTF-8"),
        (b"PK\x03\x04" + bytes(100) + b"x", "workbook"),
        ("<gpx><trk>", "begins as XML but is damaged"),
        (b"AXXX\nHFDTE010100\n", "B records|numbers|columns"),
        (ZIPPED[:-9], "cut off"),
        (PARQUET[:-100], "Parquet file is damaged"),
        ("x" * 50_005, "50,005 line, at most"),
        (",".join(["x"] * 4000) + "\n" + ",".join(["1"] * 4000) + "\n", "4,000 columns"),
    ],
    ids=range(15),
)
def test_a_broken_file_is_refused_in_one_short_line(read, content, message):
    with pytest.raises(ArgumentError, match=rf"walk\.csv.*({message})"):
        read(content)
    assert accepted(lambda: read(content)) is None


def rows(form, count=9):
    """So many lines or elements of a form, with their numbers k."""
    return "".join(form.format(k=k) for k in range(count))


KINDS = {
    "csv": "t,x,y\n" + ROWS,
    "semicolons": ROWS.replace(",", ";"),
    "objects": '"id";"T";x;y\r\n' + "".join(f"{k % 2};{k};1,5;2,25\r\n" for k in range(30)),
    "dates": "time\tlat\tlon\n" + rows("2024-05-01 10:00:{k:02d}\t55.1\t3.{k}\n"),
    "parquet": PARQUET,
    # Texts, an index and what pandas says about them.
    "parquet of texts": FRAME.map(repr).set_index("t").to_parquet(compression=None),
    "gzip": ZIPPED,
    "igc": "AXXX\nI013636LAD\n"
    + "".join(f"B1200{k:02d}4730{9 * k:03d}N00915{k:03d}EA00100001005\n" for k in range(30)),
    "gpx": '<gpx version="1.1"><trk><trkseg>'
    + rows('<trkpt lat="55.{k}" lon="3"><time>2024-05-01T10:00:{k:02d}Z</time></trkpt>')
    + "</trkseg></trk></gpx>",
    "kml": '<kml xmlns:gx="g"><gx:Track>'
    + rows("<when>2024-05-01T10:00:{k:02d}Z</when><gx:coord>3 55.{k} 9</gx:coord>")
    + "</gx:Track></kml>",
    "floating cars": "<fcd>"
    + rows('<timestep time="{k}"><vehicle id="a" x="{k}" y="1"/></timestep>')
    + "</fcd>",
    "json": '{"type": "FeatureCollection", "features": [{"type": "Feature", "properties":'
    '{"coordTimes": [1, 2, 3, 4]}, "geometry": {"type": "LineString", "coordinates":'
    "[[3, 55.1], [3, 55.2], [3, 55.3], [3, 55.4]]}}]}",
    "lines of json": rows('{{"t": {k}, "lat": 55.{k}, "lon": [3]}}\n')
    + '{"t": 9, "lat": 54, "lon": 3}\n' * 2
    + '{"t": 10, "lat": 54, "lon": 3}',
    "nmea": rows("$GPRMC,1000{k:02d},A,5{k}00.0,N,00300.0,E,9,0,010524,,,A\n"),
    "ais": "".join(f"{10 * k},!AIVDM,1,1,,B,15NG6V0P01G?cFhE`R2IU?wn28R>,0*05\n" for k in range(9)),
    "zones": "t,easting,northing,zone\n"
    + "".join(f"{k},500000,{5_000_000 + k},3{2 + (k > 6)}N\n" for k in range(9)),
    "earth-centred": "t,x,y,z\n" + rows("{k},4000000,{k},4960000\n"),
    "both in one": "t,position\n" + rows('{k},"4{k} 10 N 3 E"\n'),
}


@pytest.mark.parametrize("examples", [30, STUDY])
@pytest.mark.parametrize("kind", KINDS)
def test_a_damaged_file_is_read_or_refused(read, kind, examples):
    content = KINDS[kind]
    content = content.encode() if isinstance(content, str) else content
    assert read(content).summary

    def check(changed):
        file = accepted(lambda: read(changed))
        for recording in file.recordings if file else ():
            assert (np.diff(recording.times) > 0.0).all()
            assert np.isfinite(recording.positions[recording.measured]).all()
            assert recording.tick > 0.0
            assert "\n" not in file.summary

    attack(examples, damaged(content), check)


@pytest.mark.parametrize("text", ["[" * 20_000, "t,x" + " " * 9_000 + "[,y"])
def test_long_names_of_columns_take_no_time(read, text):
    accepted(lambda: read(text + "\n" + ROWS))


def test_size_and_rows_are_bounded(read, tmp_path, monkeypatch):
    path = tmp_path / "large.csv"
    path.write_text("x,y\n")
    # Sparse, of zeros.
    os.truncate(path, 250_000_001)
    with pytest.raises(ArgumentError, match="megabytes, at most 250"):
        read_recordings(path)
    monkeypatch.setitem(files.LIMITS, "rows", 29)
    with pytest.raises(ArgumentError, match="30 rows, at most 29"):
        read(PARQUET)


POINT = b'<trkpt lat="5" lon="3"/>'
BOMBS = {
    "compressed": (gzip.compress(b"t,x,y\n" + b"1,2,3\n" * 4_000_000), "MB when decompressed"),
    "rows": (b"t,x,y\n" + b"1,2,3\n" * 3_000_000, "rows, at most 2,500,000"),
    "cells": (
        b"x,y" + b",a" * 1990 + b"\n" + (b"1,2" + b"," * 1990 + b"\n") * 26_000,
        "cells, at most 50,000,000",
    ),
    "points": (
        b"<gpx><trk><trkseg>" + POINT * 2_600_000 + b"</trkseg></trk></gpx>",
        "2,600,000 rows, at most",
    ),
    "tags": (
        b"<gpx><trk><trkseg>" + b"<a/>" * 11_000_000 + b"</trkseg></trk></gpx>",
        "tags, at most 10,000,000",
    ),
    "fixes": (
        b"AXXX\n" + b"B1200004630000N00915000EA0010000100\n" * 2_600_000,
        "2,600,000 rows, at most",
    ),
}


@pytest.mark.parametrize("kind", BOMBS)
def test_what_would_need_much_memory_is_refused_before_it_is_read(read, kind):
    content, message = BOMBS[kind]
    tracemalloc.start()
    try:
        with pytest.raises(ArgumentError, match=message):
            read(content)
        assert tracemalloc.get_traced_memory()[1] < 500_000_000
    finally:
        tracemalloc.stop()


def test_texts_that_a_parquet_file_repeats_are_not_expanded(read):
    rows = np.arange(13_000.0)
    texts = pa.DictionaryArray.from_arrays(np.zeros(len(rows), np.int32), ["a" * 20_000])
    stream = pa.BufferOutputStream()
    table = pa.table({"t": rows, "x": rows, "y": rows, "note": texts})
    pyarrow.parquet.write_table(table, stream, compression="zstd")
    before = pa.total_allocated_bytes()

    assert len(read(stream.getvalue().to_pybytes()).recordings[0].times) == 13_000
    assert pa.default_memory_pool().max_memory() - before < 100_000_000


def test_what_is_not_a_regular_file_is_refused_without_waiting(tmp_path):
    os.mkfifo(tmp_path / "pipe.csv")
    for path in (
        tmp_path / "pipe.csv",
        "/dev/zero",
        "a" * 5000,
        "a\0b",
        tmp_path / "a\nb",
        tmp_path,
        "no.csv",
    ):
        with pytest.raises(ArgumentError, match="file="):
            read_recordings(path)
        assert accepted(lambda path=path: read_recordings(path)) is None
