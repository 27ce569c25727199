"""Recordings that are damaged, very large, or not files at all."""

import os
import tracemalloc

import numpy as np
import pytest
from agents.interface.recording_files import MAX_BYTES, MAX_LINE, read_recording, write_table
from hostile_input import accepted, damaged, profile
from hypothesis import given

from agents.interface import recording_files
from baselines.recordings import ate
from hybrid_env.checks import ArgumentError

STUDY = pytest.param(10_000, marks=pytest.mark.study)
ROWS = "".join(f"{k / 10},{k * 0.2:.3f},{(k % 7) * 0.1:.3f}\n" for k in range(30))


def read_and_track(path):
    recording = read_recording(path)
    assert np.isfinite(recording.measurements).all()
    assert recording.tau is None or recording.tau > 0.0
    ticks = len(recording.measurements)
    tracks = ate.track(
        recording.measurements, [ticks], None, radii=(5.0,), tau=0.1, process_variance=1e-3,
        measurement_variance=0.1, alpha=1e-3, beta=None, undecided="keep",
    )  # fmt: skip
    assert set(tracks.modes.tolist()) <= {0, 1, 2}
    return recording


@pytest.mark.parametrize("examples", [80, STUDY])
@pytest.mark.parametrize("content", ["t,x,y\n" + ROWS, ROWS.replace(",", ";"), '"T","x",y\n' + ROWS])
def test_a_damaged_recording_is_read_or_refused(content, examples, tmp_path):
    path = tmp_path / "flight.csv"
    path.write_text(content)
    read_and_track(path)  # also compiles

    @profile(examples)
    @given(damaged(content.encode()))
    def check(changed):
        path.write_bytes(changed)
        accepted(lambda: read_and_track(path))

    check()


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        ("x" * (MAX_LINE + 5), "line 1: a line of more than"),
        ("x,y\n" + "," * (MAX_LINE + 5), "line 2: a line of more than"),
        ("x,y\n" + "1" * 9000 + ",2\n", "line 2: x='1111"),
        ('x,y\n"1\n","2"\n', "line 2: not CSV"),
        ("x,y\n1,2\n\ud800,3\n", "UTF-8"),
        ("x,y," + "n" * 9000 + "\n1,2\n", "3 cells"),
        (",".join(["x"] * 4000) + "\n", "header="),
    ],
)
def test_long_lines_are_refused_in_one_short_line(content, reason, tmp_path):
    path = tmp_path / "flight.csv"
    path.write_bytes(content.encode("utf-8", "surrogatepass"))
    with pytest.raises(ArgumentError, match=reason):
        read_recording(path)
    assert accepted(lambda: read_recording(path)) is None


def test_a_line_without_end_is_not_read_into_memory(tmp_path):
    path = tmp_path / "flight.csv"
    path.write_text("x,y\n")
    os.truncate(path, MAX_BYTES)  # sparse, of zeros
    tracemalloc.start()
    try:
        with pytest.raises(ArgumentError, match="line 2: a line of more than"):
            read_recording(path)
        assert tracemalloc.get_traced_memory()[1] < 10_000_000
    finally:
        tracemalloc.stop()
    os.truncate(path, MAX_BYTES + 1)
    with pytest.raises(ArgumentError, match="at most 250 MB"):
        read_recording(path)


def test_the_number_of_rows_is_bounded_and_the_progress_reported(tmp_path, monkeypatch):
    path = tmp_path / "flight.csv"
    monkeypatch.setattr(recording_files, "MAX_ROWS", 30)
    monkeypatch.setattr(recording_files, "PROGRESS_ROWS", 10)
    fractions = []
    path.write_text("t,x,y\n" + ROWS)
    assert len(read_recording(path, fractions.append).measurements) == 30
    assert len(fractions) == 3
    assert all(0.0 < fraction <= 1.0 for fraction in fractions)
    path.write_text("t,x,y\n" + ROWS + "3.0,1,2\n")
    with pytest.raises(ArgumentError, match="line 32: more than 30 rows"):
        read_recording(path)


def test_a_table_is_written_in_parts(tmp_path, monkeypatch):
    monkeypatch.setattr(recording_files, "WRITTEN_ROWS", 7)
    write_table(tmp_path / "a.csv", {"x": np.arange(30.0), "y": list(range(30))})
    monkeypatch.undo()
    write_table(tmp_path / "b.csv", {"x": np.arange(30.0), "y": list(range(30))})
    assert (tmp_path / "a.csv").read_text() == (tmp_path / "b.csv").read_text()
    assert len(read_recording(tmp_path / "a.csv").measurements) == 30


def test_what_is_not_a_regular_file_is_refused_without_waiting(tmp_path):
    os.mkfifo(tmp_path / "pipe.csv")
    for path in (tmp_path / "pipe.csv", "/dev/zero", "a" * 5000, "a\0b", tmp_path / "a\nb"):
        with pytest.raises(ArgumentError, match="file="):
            read_recording(path)
        assert accepted(lambda path=path: read_recording(path)) is None
