"""Times in all forms, their order, missing rows and gaps."""

import numpy as np
import pandas as pd
import pytest

from baselines.recordings.recording import make_recording
from hybrid_env.checks import ArgumentError

ROWS = 40
SECONDS = 0.25 * np.arange(ROWS)
START = pd.Timestamp("2024-05-01T10:00:00")
DATES = START + pd.to_timedelta(SECONDS, unit="s")
EPOCH = START.timestamp()
POSITIONS = np.column_stack([np.arange(ROWS), np.sqrt(np.arange(ROWS))])
AMERICAN = DATES.strftime("%m/%d/%Y %I:%M:%S.%f %p")


@pytest.fixture
def read_times(read):
    """Return a function that reads a file with cells in the column of times."""

    def read_times(cells, name="t", **options):
        frame = pd.DataFrame(
            {
                name: cells,
                "x": POSITIONS[:, 0],
                "y": POSITIONS[:, 1],
            }
        )
        file = read(frame.to_csv(index=False, sep=";"), **options)
        return file.recordings[0], file.summary

    return read_times


FORMS = {
    "seconds": (SECONDS + 7.0, "t", None),
    "milliseconds by their name": (SECONDS * 1e3 + 7e3, "time [ms]", None),
    "minutes by their name": (SECONDS / 60.0 + 7.0 / 60.0, "t_min", None),
    "since 1970 in s": (SECONDS + EPOCH, "timestamp", START),
    "since 1970, scale in brackets": (SECONDS + EPOCH, "Time (UTC)", START),
    "since 1970 in ms": (np.int64((SECONDS + EPOCH) * 1e3), "t", START),
    "since 1970 in us": (np.int64((SECONDS + EPOCH) * 1e6), "t", START),
    "since 1970 in ns": (
        np.int64(np.int64(EPOCH) * 10**9) + np.int64(SECONDS * 1e9),
        "t_ns",
        START,
    ),
    "ISO": (DATES.strftime("%Y-%m-%dT%H:%M:%S.%f"), "datetime", START),
    "ISO with zone": (
        DATES.strftime("%Y-%m-%d %H:%M:%S.%f+02:00"),
        "t",
        START - pd.Timedelta("2h"),
    ),
    "ISO with decimal comma": (DATES.strftime("%Y-%m-%d %H:%M:%S,%f"), "t", START),
    "basic ISO": (DATES.strftime("%Y%m%dT%H%M%S.%fZ"), "t", START),
    "day.month.year": (DATES.strftime("%d.%m.%Y %H:%M:%S.%f"), "t", START),
    "day.month.year, comma": (DATES.strftime("%d.%m.%Y %H:%M:%S,%f"), "t", START),
    "time of day": (DATES.strftime("%H:%M:%S.%f"), "t", None),
}


@pytest.mark.parametrize("form", FORMS)
def test_forms_of_times(read_times, form):
    cells, name, start = FORMS[form]
    recording, summary = read_times(cells, name)
    offset = 36_000.0 if form == "time of day" else 7.0 if start is None else 0.0

    np.testing.assert_allclose(recording.times, SECONDS + offset, atol=1e-6)
    assert recording.epoch == (None if start is None else f"{start.isoformat()}Z")
    assert recording.time_unit == "s"
    assert "tick 0.25 s" in summary
    assert (start is None) == (" from 20" not in summary)


def test_the_format_or_unit_of_the_caller(read_times):
    recording, _ = read_times(AMERICAN, time_unit="%m/%d/%Y %I:%M:%S.%f %p")
    np.testing.assert_allclose(recording.times, SECONDS)
    recording, summary = read_times(SECONDS, time_unit="ms")
    np.testing.assert_allclose(recording.times, SECONDS / 1e3)
    assert "times are in ms" in summary
    assert read_times(SECONDS, tau=0.2502)[0].tick == 0.25


@pytest.mark.parametrize(
    ("cells", "options", "message"),
    [
        (AMERICAN, {}, r"line 2: t='05/01/2024 .*ISO date, or --time-unit"),
        (SECONDS, {"time_unit": "weeks"}, r"time_unit='weeks'.*one of s, "),
        (SECONDS, {"name": "t [weeks]"}, r"walk.csv: unit of t \[weeks\]='weeks'.*--time-unit"),
        (SECONDS, {"name": "speed", "time_unit": "s"}, r"time_unit='s'.*no times"),
        (SECONDS, {"tau": 0.3}, r"tau=0.3.*the median step of the times, 0.25"),
        (SECONDS, {"gap": 0}, "gap=0"),
    ],
)
def test_options_that_do_not_fit_the_times(read_times, cells, options, message):
    with pytest.raises(ArgumentError, match=message):
        read_times(cells, **options)


@pytest.mark.parametrize(
    ("times", "row", "cell", "message"),
    [
        (SECONDS, 5, "soon", r"line 7: t='soon'.*--time-unit"),
        (SECONDS, 5, "", r"line 7: t: the cell is empty: expected a time in every row"),
        (SECONDS, 5, "inf", r"line 7: t='inf'"),
        (SECONDS, 0, "-", r"line 2: t='-'"),
        (
            SECONDS,
            5,
            "0.5",
            r"line 7: t='0.5' is not allowed: expected a time after 1.0 .*--object",
        ),
        (
            SECONDS,
            5,
            "1.0",
            r"line 7: t='1.0' is not allowed: expected a time after 1.0 .*--object",
        ),
        (DATES, 7, "2024-13-01 00:00:00", "line 9: t='2024-13-01 00:00:00'"),
        (DATES, 7, "later", "line 9: t='later'"),
        (DATES, 7, "NaT", "line 9: t='NaT'"),
        (
            FORMS["day.month.year"][0],
            0,
            "",
            "line 2: t: the cell is empty: expected a time in every row",
        ),
    ],
)
def test_broken_times(read_times, times, row, cell, message):
    cells = times.strftime("%Y-%m-%d %H:%M:%S.%f") if times is DATES else times
    with pytest.raises(ArgumentError, match=message):
        read_times([*map(str, cells[:row]), cell, *map(str, cells[row + 1 :])])


def test_missing_rows_and_gaps(read, read_one):
    times = np.delete(SECONDS, [3, 4])
    times[20:] += 6.0
    positions = np.delete(POSITIONS, [3, 4], axis=0)
    frame = pd.DataFrame(
        {
            "t": times,
            "x": positions[:, 0],
            "y": positions[:, 1],
        }
    )
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
        None,
        [[0.0, 1.0], [np.nan, 5.0], [2.0, 2.0], [4.0, 3.0]],
        breaks=[3],
    )
    np.testing.assert_array_equal(recording.times, [0, 1, 2, 3])
    assert recording.pieces == ((0, 3), (3, 4))
    assert not recording.positions.flags.writeable
    assert make_recording([3, 4, 6], np.ones((3, 2)), gap=1.5).pieces == ((0, 2), (2, 3))


@pytest.mark.parametrize(
    ("times", "positions", "message"),
    [
        ([0, 1], np.ones((2, 3)), r"positions has shape \(2, 3\)"),
        ([0, 1], [[0, 1], [np.inf, 1]], "positions=inf"),
        ([0, 1], [[0, 1], [np.nan, 1]], "1 measured positions"),
        ([0, 0], np.ones((2, 2)), r"times\[1\]=0.0.*after 0"),
        ([0, 1, 2], np.ones((2, 2)), r"times has shape \(3,\)"),
    ],
)
def test_arrays_that_are_no_recording(times, positions, message):
    with pytest.raises(ArgumentError, match=message):
        make_recording(times, positions)


@pytest.mark.parametrize(
    "form",
    ["%Y%Y", "%H %H", "%", "%Q", "%Y%", "(%Y", "%Y [", "%*", "%\\", "%G", "%Y-%V-%G-%V"],
)
def test_a_format_that_is_none_is_refused_in_one_line(read_times, form):
    with pytest.raises(ArgumentError) as caught:
        read_times(AMERICAN, time_unit=form)
    assert "\n" not in str(caught.value)


def clock_cells(seconds, prefix=""):
    """Times of day as numbers, 101500 for a quarter past ten."""
    start = START + pd.Timedelta("15min")
    dates = start + pd.to_timedelta(seconds, unit="s")
    texts = dates.strftime("%H%M%S.%f" if np.any(np.array(seconds) % 1) else "%H%M%S")
    return [prefix + text for text in texts]


@pytest.mark.parametrize(
    "step",
    [0.7, 1.0, 2.0, 7.0, 30.0, 400.0],
)
@pytest.mark.parametrize("prefix", ["", "20260501"])
def test_times_of_day_as_numbers_are_not_taken_for_seconds(read_times, step, prefix):
    recording, summary = read_times(clock_cells(3.0 * step * np.arange(ROWS), prefix), "TIME")
    # Numbers of 14 digits.
    np.testing.assert_allclose(
        np.diff(recording.times),
        3.0 * step,
        atol=0.01,
    )
    assert "hours, minutes and seconds (HHMMSS)" in summary


def test_times_of_day_over_several_dates_need_a_format(read_times):
    dates = START + pd.to_timedelta(3600.0 * np.arange(ROWS), unit="s")
    with pytest.raises(ArgumentError, match="--time-unit with a format"):
        read_times(dates.strftime("%Y%m%d%H%M%S"), "TIME")
    recording, _ = read_times(dates.strftime("%Y%m%d%H%M%S"), "TIME", time_unit="%Y%m%d%H%M%S")

    np.testing.assert_allclose(np.diff(recording.times), 3600.0)


@pytest.mark.parametrize(
    "seconds",
    [
        np.arange(ROWS),
        100.0 * np.arange(ROWS),
        7.0 + 3.0 * np.arange(ROWS),
        np.arange(ROWS) ** 1.5,
        59.0 * np.arange(ROWS),
    ],
)
def test_seconds_stay_seconds(read_times, seconds):
    np.testing.assert_allclose(read_times(seconds)[0].times, seconds)
    clock = clock_cells(3.0 * np.arange(ROWS))
    np.testing.assert_allclose(
        read_times(clock, time_unit="s")[0].times,
        np.array(clock, float),
    )


@pytest.mark.parametrize(
    "time",
    [
        "01.05.2024 10:00:0{}",
        "171455760{}",
        "10:00:0{}",
        "2024/05/01 10:00:0{}",
        "May 1 2024 10:00:0{}",
        "2024-05-01",
        "soon",
    ],
)
@pytest.mark.parametrize("wrong", [range(9), [4]])
def test_times_of_a_gpx_file_that_cannot_be_read_are_refused(read, time, wrong):
    times = [time.format(k) if k in wrong else f"2024-05-01T10:00:0{k}Z" for k in range(9)]
    points = "".join(
        f'<trkpt lat="55.00{k}" lon="3"><time>{one}</time></trkpt>' for k, one in enumerate(times)
    )
    with pytest.raises(ArgumentError, match=r"walk.csv: time='.*an ISO date and time"):
        read(f'<gpx version="1.1"><trk><trkseg>{points}</trkseg></trk></gpx>')


def test_a_gpx_file_without_times_has_ticks(read):
    points = "".join(f'<trkpt lat="55.00{k}" lon="3"/>' for k in range(9))
    metadata = "<metadata><time>yesterday</time></metadata>"

    assert (
        "no times: a row is a tick"
        in read(f"<gpx>{metadata}<trk><trkseg>{points}</trkseg></trk></gpx>").summary
    )
