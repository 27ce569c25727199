"""Times in all forms, their order, missing rows and gaps."""

import numpy as np
import pandas as pd
import pytest

from baselines.recordings.recording import make_recording

ROWS = 40
SECONDS = 0.25 * np.arange(ROWS)
START = pd.Timestamp("2024-05-01T10:00:00")
DATES = START + pd.to_timedelta(SECONDS, unit="s")
POSITIONS = np.column_stack([np.arange(ROWS), np.sqrt(np.arange(ROWS))])
AMERICAN = DATES.strftime("%m/%d/%Y %I:%M:%S.%f %p")


@pytest.fixture
def read_times(read):
    """Return a function that reads a file with cells in the column of times."""

    def read_times(cells, name="t", **options):
        frame = pd.DataFrame({name: cells, "x": POSITIONS[:, 0], "y": POSITIONS[:, 1]})
        file = read(frame.to_csv(index=False, sep=";"), **options)
        return file.recordings[0], file.summary

    return read_times


def test_the_format_or_unit_of_the_caller(read_times):
    recording, _ = read_times(AMERICAN, time_unit="%m/%d/%Y %I:%M:%S.%f %p")
    np.testing.assert_allclose(recording.times, SECONDS)
    recording, summary = read_times(SECONDS, time_unit="ms")
    np.testing.assert_allclose(recording.times, SECONDS / 1e3)
    assert "times are in ms" in summary
    assert read_times(SECONDS, tau=0.2502)[0].tick == 0.25


def test_missing_rows_and_gaps(read, read_one):
    times = np.delete(SECONDS, [3, 4])
    times[20:] += 6.0
    positions = np.delete(POSITIONS, [3, 4], axis=0)
    frame = pd.DataFrame({"t": times, "x": positions[:, 0], "y": positions[:, 1]})
    frame.loc[[0, 7, 8, 19], "x"] = np.nan

    assert "4 rows without a position; 2 pieces between gaps" in read(frame).summary
    recording = read_one(frame)
    assert recording.pieces == ((1, 19), (20, 38))
    assert np.flatnonzero(~recording.measured).tolist() == [0, 7, 8, 19]
    assert np.isnan(recording.positions[7]).all()
    assert read_one(frame, gap=7.0).pieces == ((1, 38),)
    assert read_one(frame, gap=0.5).pieces == ((1, 3), (3, 7), (9, 19), (20, 38))


def test_recording_of_arrays():
    recording = make_recording(
        None, [[0.0, 1.0], [np.nan, 5.0], [2.0, 2.0], [4.0, 3.0]], breaks=[3]
    )
    np.testing.assert_array_equal(recording.times, [0, 1, 2, 3])
    assert recording.pieces == ((0, 3), (3, 4))
    assert not recording.positions.flags.writeable
    assert make_recording([3, 4, 6], np.ones((3, 2)), gap=1.5).pieces == ((0, 2), (2, 3))
