"""Rows of real sensors that are no measurements of their own are left out, sorted and counted."""

import re

import numpy as np
import pandas as pd
import pytest
from recorded_tracks import directions

from hybrid_env.checks import ArgumentError

ROWS = 200
T = np.arange(ROWS, dtype=np.float64)
HEADING = np.cumsum(np.where((T // 40) % 2 == 0, 0.0, 0.1))
TRACK = np.cumsum(1.5 * directions(HEADING), axis=0)
TRACK += np.random.default_rng(0).normal(0.0, 0.2, (ROWS, 2))
FRAME = pd.DataFrame({"time": T, "x": TRACK[:, 0], "y": TRACK[:, 1]})
LINES = FRAME.round(3).to_csv(index=False).splitlines()


def inserted(*more):
    """Lines of the file with others at (number, text)."""
    lines = list(LINES)
    for number, text in reversed(more):
        lines.insert(number, text)
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize(
    ("more", "left_out"),
    [
        ([(1, "s,m,m")], {"headers and comments": 1}),
        ([(5, "s,m,m")], {"rows without a time": 1}),
        ([(9, LINES[0]), (50, LINES[0])], {"headers and comments": 2}),
        ([(9, ""), (60, "  ")], {"blank lines": 2}),
        ([(9, "# recording paused"), (201, "# 200 rows")], {"headers and comments": 2}),
        ([(9, "3.5,1.2"), (20, "1,2,3,4,5")], {"rows with another number of cells": 2}),
        ([(9, LINES[9]), (80, LINES[20])], {"repeated times": 2}),
        ([(9, "8.5,abc,2.0"), (30, "28.5,1.0,inf")], {"rows whose position cannot be read": 2}),
        ([(60, ",,")], {"blank lines": 1}),
        ([(0, "Logger 3.1"), (0, "Date: today")], {"headers and comments": 2}),
    ],
)
def test_rows_are_left_out_and_counted(read, more, left_out):
    content = inserted(*more)
    file = read(content)

    assert file.left_out == left_out
    assert not file.warnings
    np.testing.assert_array_equal(file.recordings[0].times, T)
    np.testing.assert_array_equal(file.recordings[0].positions, FRAME.round(3)[["x", "y"]])
    for reason, count in left_out.items():
        assert f"{reason} ({count})" in file.summary
    [reason] = left_out
    with pytest.raises(ArgumentError, match=rf"line \d+: {reason}"):
        read(content, bad_rows="refuse")


def test_a_clock_that_is_set_back_begins_a_new_piece(read):
    frame = FRAME.assign(time=np.where(T < 120, T, T - 3600.0))
    file = read(frame)
    assert file.recordings[0].pieces == ((0, 120), (120, ROWS))
    np.testing.assert_array_equal(file.recordings[0].positions, TRACK)
    assert "the clock was set back" in file.summary


def test_more_than_a_tenth_is_a_warning_and_more_than_half_a_refusal(read):
    cells = FRAME.round(3).astype(str)
    cells.loc[::5, "x"] = "lost"
    file = read(cells)
    reason = "rows whose position cannot be read (40)"
    path = file.summary.split(":")[0]
    assert file.warnings == (f"{path}: 40 of 200 rows are left out: {reason}",)
    cells.loc[:69, "x"] = "lost"
    cells.loc[70:129, "time"] = "lost"
    with pytest.raises(ArgumentError, match="more than half of walk is left out"):
        read(cells)


@pytest.mark.parametrize("scale", [1.0, 60.0])
@pytest.mark.parametrize("column", [False, True])
def test_positions_that_a_stale_source_repeats(read, scale, column):
    """A source gives the last position until it has a new one, after 3 to 8 rows."""
    rng = np.random.default_rng(1)
    fresh = np.unique(np.cumsum(rng.integers(3, 9, ROWS)).clip(0, ROWS - 1))
    last = fresh[np.searchsorted(fresh, np.arange(fresh[0], ROWS), side="right") - 1]
    frame = pd.DataFrame({"time": scale * T[fresh[0] :], "x": TRACK[last, 0], "y": TRACK[last, 1]})
    if column:
        frame["time_position"] = scale * T[last]
    [recording] = read(frame).recordings
    np.testing.assert_array_equal(recording.times, scale * T[fresh])
    np.testing.assert_array_equal(recording.positions, TRACK[fresh])


def test_an_object_that_stands_still_and_rounded_positions_are_no_stale_source(read):
    still = np.concatenate([TRACK[:80], np.repeat(TRACK[80:81], 60, axis=0), TRACK[81:141]])
    standing = FRAME.assign(time=T, x=still[:, 0], y=still[:, 1])
    coarse = FRAME.assign(x=np.round(TRACK[:, 0] / 4.0) * 4.0, y=0.0)
    for frame in (standing, coarse):
        assert len(read(frame, unit="m").recordings[0].times) == ROWS


@pytest.mark.parametrize(("unit", "first"), [(1, 0), (10, 0), (60, 0), (60, 4)])
def test_rounded_times_are_spread(read, unit, first):
    """Also if the first rows are the last ones of their minute."""
    times = unit * T[first:] / 6.0
    frame = FRAME[first:].assign(time=np.floor(times / unit) * unit)
    file = read(frame)
    np.testing.assert_allclose(file.recordings[0].times, times, atol=1e-9)
    assert f"several rows at each time are spread over {unit} s" in file.summary


def test_times_that_two_receivers_repeat_are_not_rounded(read):
    """Every ten seconds, a place that both have measured."""
    other = FRAME.assign(x=FRAME.x + 0.05)
    frame = pd.concat([FRAME, other]).sort_values("time", kind="stable")
    file = read(frame.assign(time=10.0 * frame.time))
    np.testing.assert_array_equal(file.recordings[0].times, 10.0 * T)
    np.testing.assert_array_equal(file.recordings[0].positions, TRACK)


@pytest.mark.parametrize("objects", [2, 3])
def test_objects_without_a_column_are_warned_of_or_refused(read, objects):
    others = [FRAME.assign(y=FRAME.y + 5.0 * k, player=k) for k in range(objects)]
    frame = pd.concat(others).assign(time=lambda rows: 0.04 * rows.time)
    frame = frame.sort_values(["time", "player"])
    nameless = frame.drop(columns="player")
    hint = "repeated times at other places .*name their column by --object"
    if objects == 2:
        [warning] = read(nameless).warnings
        assert re.search(hint, warning)
    else:
        with pytest.raises(ArgumentError, match=f"more than half.*{hint}"):
            read(nameless)
    assert len(read(frame).recordings) == objects
    assert len(read(frame, object_column="player").recordings) == objects
    assert len(read(frame, object_column="none").recordings) == 1


def test_thousands_by_option(read):
    frame = FRAME.assign(x=[f"{x + 5000.0:,.3f}" for x in TRACK[:, 0]])
    with pytest.raises(ArgumentError, match=r"x='5,00.*--thousands"):
        read(frame.to_csv(index=False, sep=";"))
    [recording] = read(frame.to_csv(index=False, sep=";"), thousands=",").recordings
    np.testing.assert_allclose(recording.positions[:, 0], TRACK[:, 0] + 5000.0, atol=1e-3)
