"""Rows of an object that are no measurements of their own: they are left out and counted."""

import numpy as np

from baselines.recordings.reading.files import Table
from baselines.recordings.reading.values import DAY
from hybrid_env.checks import FloatArray, IntArray


def ordered_rows(
    table: Table,
    seconds: FloatArray,
    rows: IntArray,
    spread: bool = False,
) -> tuple[IntArray, FloatArray]:
    """Return the rows (k,) of an object in the order of their times, and the times.

    Rows out of order are sorted. A clock that was set back, so that many rows follow at times that
    were before, goes on a day later: a new piece begins. Of rows with one time the first is kept;
    with `spread`, where most seconds have several rows, they are spread over the second.
    """
    times = seconds[rows]
    table.leave_out("rows without a time", table.lines[rows[np.isnan(times)]])
    rows, times = rows[~np.isnan(times)], times[~np.isnan(times)]
    if len(rows) > 1 and (np.diff(times) < 0.0).mean() > 0.5:
        # The newest row is the first one.
        rows, times = rows[::-1], times[::-1]
        table.notes.append("rows sorted from the last to the first")
    set_back = np.flatnonzero(np.diff(times) < 0.0) + 1
    late = times < np.maximum.accumulate(times)
    if len(set_back) and late.sum() > 10 * len(set_back):
        times = times + DAY * np.cumsum(np.isin(np.arange(len(times)), set_back))
        table.notes.append(
            f"times that the clock was set back, where a new piece begins: {len(set_back)}"
        )
    elif len(set_back):
        table.notes.append(f"rows out of order, which are sorted: {int(late.sum())}")
    order = np.argsort(times, kind="stable")
    rows, times = rows[order], times[order]
    instants, first, counts = np.unique(times, return_index=True, return_counts=True)
    whole = len(instants) > 2 and not (instants % 1.0).any()
    if spread and whole and np.median(counts) >= 2.0:
        places = np.arange(len(times)) - np.repeat(first, counts)
        table.notes.append("several rows in each second are spread over it")
        return rows, times + places / np.repeat(np.maximum(counts, np.median(counts)), counts)
    repeated = np.setdiff1d(np.arange(len(times)), first)
    table.leave_out("repeated times", table.lines[rows[repeated]])
    return rows[first], times[first]


def fresh_rows(times: FloatArray, positions: FloatArray) -> IntArray:
    """Return which rows (k,) have a position of their own. A stale source repeats the last position
    until it has a new one, which is then further away the longer it has repeated; an object that
    stands still goes on as if no time had passed, and rounded positions change by their last digit.
    """
    everything = np.arange(len(times))
    moved = np.append(True, (np.diff(positions, axis=0) != 0.0).any(axis=1))
    fresh = np.flatnonzero(moved)
    if len(fresh) < 8 or len(fresh) > 0.9 * len(times):
        return everything
    lengths = np.hypot(*np.diff(positions[fresh], axis=0).T)
    since_first = np.diff(times[fresh])
    since_last = times[fresh[1:]] - times[fresh[1:] - 1]
    spreads = [np.std(np.log(lengths / passed)) for passed in (since_first, since_last)]
    steps = np.abs(np.diff(positions[fresh], axis=0))
    last_digit = steps[steps > 0.0].min()
    if np.median(lengths) < 5.0 * last_digit or spreads[0] >= spreads[1]:
        return everything
    return fresh


def rows_alternate(positions: FloatArray) -> bool:
    """Whether many rows are far from the row before, but near to one of the three before that, as
    those of several objects in one file.
    """
    window = 4
    if len(positions) < 2 * window:
        return False
    before = np.array(
        [
            np.hypot(*(positions[window:] - positions[window - lag : -lag]).T)
            for lag in range(1, window + 1)
        ]
    )
    nearest = before.min(axis=0)
    return bool(np.median(nearest) > 0.0 and (before[0] > 10.0 * nearest).mean() >= 0.25)


def look_like_degrees(times: FloatArray, positions: FloatArray) -> bool:
    """Whether x and y may be degrees: in their range, slow, and far from 0 for their extent."""
    largest = np.abs(positions).max(axis=0)
    extent = np.ptp(positions, axis=0)
    if largest.max() > 180.0 or largest.min() > 90.0 or not extent.any():
        return False
    speeds = np.abs(np.diff(positions, axis=0)).max(axis=1) / np.diff(times)
    offset = np.abs(np.median(positions, axis=0)).max()
    # Objects move by less than 0.01 degrees in a second, and most of them by more metres. Degrees
    # are twice their extent from 0, and at least one degree.
    return bool(np.median(speeds) < 0.01 and offset > max(2.0 * extent.max(), 1.0))


def reasons(table: Table) -> list[str]:
    """Return what was left out, a phrase for each reason."""
    return [f"{reason} ({len(lines):,})" for reason, lines in table.left_out.items()]


def lost(table: Table) -> int:
    """Return the number of rows left out that should have been measurements."""
    harmless = (
        "lines before the header",
        "blank lines",
        "comments",
        "repeated headers",
        "repeated times",
        "positions that a stale source repeats",
    )
    return sum(len(lines) for reason, lines in table.left_out.items() if reason not in harmless)
