"""Times in all forms, their order, missing rows and gaps."""

import numpy as np
import pandas as pd
import pytest

from baselines.recordings.reading.read import read_recordings
from baselines.recordings.recording import make_recording
from hybrid_env.checks import ArgumentError

ROWS = 40
SECONDS = 0.25 * np.arange(ROWS)
START = pd.Timestamp("2024-05-01T10:00:00")
DATES = START + pd.to_timedelta(SECONDS, unit="s")
POSITIONS = np.column_stack([np.arange(ROWS), np.sqrt(np.arange(ROWS))])


def read(tmp_path, cells, name="t", **options):
    frame = pd.DataFrame({name: cells, "x": POSITIONS[:, 0], "y": POSITIONS[:, 1]})
    frame.to_csv(tmp_path / "walk.csv", index=False, sep=";")
    file = read_recordings(tmp_path / "walk.csv", **options)
    [recording] = file.recordings
    return recording, file.summary


EPOCH = START.timestamp()
FORMS = {
    "seconds": (SECONDS + 7.0, "t", None),
    "milliseconds by their name": (SECONDS * 1e3 + 7e3, "time [ms]", None),
    "minutes by their name": (SECONDS / 60.0 + 7.0 / 60.0, "t_min", None),
    "since 1970 in s": (SECONDS + EPOCH, "timestamp", START),
    "since 1970, scale in brackets": (SECONDS + EPOCH, "Time (UTC)", START),
    "since 1970 in ms": (np.int64((SECONDS + EPOCH) * 1e3), "t", START),
    "since 1970 in us": (np.int64((SECONDS + EPOCH) * 1e6), "t", START),
    "since 1970 in ns": (np.int64(np.int64(EPOCH) * 10**9) + np.int64(SECONDS * 1e9), "t_ns", START),
    "ISO": (DATES.strftime("%Y-%m-%dT%H:%M:%S.%f"), "datetime", START),
    "ISO with zone": (DATES.strftime("%Y-%m-%d %H:%M:%S.%f+02:00"), "t", START - pd.Timedelta("2h")),
    "ISO with decimal comma": (DATES.strftime("%Y-%m-%d %H:%M:%S,%f"), "t", START),
    "basic ISO": (DATES.strftime("%Y%m%dT%H%M%S.%fZ"), "t", START),
    "day.month.year": (DATES.strftime("%d.%m.%Y %H:%M:%S.%f"), "t", START),
    "day.month.year, comma": (DATES.strftime("%d.%m.%Y %H:%M:%S,%f"), "t", START),
    "time of day": (DATES.strftime("%H:%M:%S.%f"), "t", None),
}


@pytest.mark.parametrize("form", FORMS)
def test_forms_of_times(tmp_path, form):
    cells, name, start = FORMS[form]
    recording, summary = read(tmp_path, cells, name)
    offset = {None: 7.0}.get(start, 0.0) if form != "time of day" else 36_000.0
    np.testing.assert_allclose(recording.times, SECONDS + offset, atol=1e-6)
    assert recording.epoch == (None if start is None else f"{start.isoformat()}Z")
    assert recording.time_unit == "s"
    assert "tick 0.25 s" in summary
    assert (start is None) == (" from 20" not in summary)


def test_nanoseconds_since_1970_keep_their_precision(tmp_path):
    nanoseconds = np.int64(np.int64(EPOCH) * 10**9) + 3 * np.arange(ROWS)
    recording, _ = read(tmp_path, nanoseconds)
    np.testing.assert_allclose(recording.times, 3e-9 * np.arange(ROWS), rtol=1e-12)


def test_the_format_or_unit_of_the_caller(tmp_path):
    american = DATES.strftime("%m/%d/%Y %I:%M:%S.%f %p")
    with pytest.raises(ArgumentError, match=r"line 2: t='05/01/2024 .*ISO date, or --time-unit"):
        read(tmp_path, american)
    recording, _ = read(tmp_path, american, time_unit="%m/%d/%Y %I:%M:%S.%f %p")
    np.testing.assert_allclose(recording.times, SECONDS)
    recording, summary = read(tmp_path, SECONDS, time_unit="ms")
    np.testing.assert_allclose(recording.times, SECONDS / 1e3)
    assert "times are in ms" in summary
    with pytest.raises(ArgumentError, match=r"time_unit='weeks'.*one of s, "):
        read(tmp_path, SECONDS, time_unit="weeks")
    with pytest.raises(ArgumentError, match=r"walk.csv: unit of t \[weeks\]='weeks'.*--time-unit"):
        read(tmp_path, SECONDS, "t [weeks]")
    with pytest.raises(ArgumentError, match=r"time_unit='s'.*no times"):
        read(tmp_path, SECONDS, "speed", time_unit="s")


@pytest.mark.parametrize(
    ("row", "cell", "message"),
    [
        (5, "soon", r"line 7: t='soon'.*--time-unit"),
        (5, "", r"line 7: t: the cell is empty: expected a time in every row"),
        (5, "inf", r"line 7: t='inf'"),
        (0, "-", r"line 2: t='-'"),
        (5, 0.5, r"line 7: t='0.5' is not allowed: expected a time after 1.0 .*--object"),
        (5, 1.0, r"line 7: t='1.0' is not allowed: expected a time after 1.0 .*--object"),
    ],
)
def test_broken_times(tmp_path, row, cell, message):
    cells = [str(second) for second in SECONDS]
    cells[row] = str(cell)
    with pytest.raises(ArgumentError, match=message):
        read(tmp_path, cells)


def test_broken_dates(tmp_path):
    cells = DATES.strftime("%Y-%m-%d %H:%M:%S.%f").to_list()
    for cell in ("2024-13-01 00:00:00", "later", "NaT"):
        with pytest.raises(ArgumentError, match=rf"line 9: t='{cell}'"):
            read(tmp_path, [*cells[:7], cell, *cells[8:]])


def test_jittered_and_irregular_steps_are_kept(tmp_path):
    times = SECONDS + np.random.default_rng(0).uniform(-0.1, 0.1, ROWS)
    recording, summary = read(tmp_path, times)
    np.testing.assert_array_equal(recording.times, times)
    assert recording.tick == np.median(np.diff(times))
    assert f"(steps {np.diff(times).min():.4g} to {np.diff(times).max():.4g})" in summary


def test_missing_rows_and_gaps(tmp_path):
    times = np.delete(SECONDS, [3, 4])
    times[20:] += 6.0
    positions = np.delete(POSITIONS, [3, 4], axis=0)
    frame = pd.DataFrame({"t": times, "x": positions[:, 0], "y": positions[:, 1]})
    frame.loc[[0, 7, 8, 19], "x"] = np.nan
    frame.to_csv(tmp_path / "walk.csv", index=False)
    file = read_recordings(tmp_path / "walk.csv")
    [recording] = file.recordings
    assert recording.pieces == ((1, 19), (20, 38))
    assert np.flatnonzero(~recording.measured).tolist() == [0, 7, 8, 19]
    assert np.isnan(recording.positions[7]).all()
    assert "4 rows without a position; 2 pieces between gaps" in file.summary
    assert read_recordings(tmp_path / "walk.csv", gap=7.0).recordings[0].pieces == ((1, 38),)
    pieces = read_recordings(tmp_path / "walk.csv", gap=0.5).recordings[0].pieces
    assert pieces == ((1, 3), (3, 7), (9, 19), (20, 38))
    with pytest.raises(ArgumentError, match="gap=0"):
        read_recordings(tmp_path / "walk.csv", gap=0)


def test_a_tick_that_contradicts_the_times_is_refused(tmp_path):
    assert read(tmp_path, SECONDS, tau=0.2502)[0].tick == 0.25
    with pytest.raises(ArgumentError, match=r"tau=0.3.*the median step of the times, 0.25"):
        read(tmp_path, SECONDS, tau=0.3)


def test_recording_of_arrays():
    recording = make_recording(None, [[0.0, 1.0], [np.nan, 5.0], [2.0, 2.0], [4.0, 3.0]], tau=0.1, breaks=[3])
    np.testing.assert_array_equal(recording.times, [0.0, 0.1, 0.2, 0.3])
    assert recording.pieces == ((0, 3), (3, 4))
    assert not recording.positions.flags.writeable
    assert make_recording([3, 4, 6], np.ones((3, 2)), gap=1.5).pieces == ((0, 2), (2, 3))
    for times, positions, message in (
        ([0, 1], np.ones((2, 3)), r"positions has shape \(2, 3\)"),
        ([0, 1], [[0, 1], [np.inf, 1]], "positions=inf"),
        ([0, 1], [[0, 1], [np.nan, 1]], "1 measured positions"),
        ([0, 0], np.ones((2, 2)), r"times\[1\]=0.0.*after 0"),
        ([0, 1, 2], np.ones((2, 2)), r"times has shape \(3,\)"),
    ):
        with pytest.raises(ArgumentError, match=message):
            make_recording(times, positions)
