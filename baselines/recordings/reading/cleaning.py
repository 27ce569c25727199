"""Rows of an object that are no measurements of their own: they are left out and counted."""

from collections.abc import Collection
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd

from baselines.recordings.reading.table import REPEATED, Table
from baselines.recordings.reading.values import DAY
from hybrid_env.checks import BoolArray, FloatArray, IntArray

# Fewer steps do not tell how an object moves.
FEWEST = 20
# Reason of rows that may be of another object.
ELSEWHERE = "repeated times at other places"
STALE = "positions that a stale source repeats"
SET_BACK = "times that the clock was set back, where a new piece begins"


def ahead_rows(times: FloatArray) -> BoolArray:
    """Return which times (n,) are wrong, as they are after many that follow: up to ten between two
    jumps of the clock.
    """
    ahead = np.zeros(len(times), np.bool_)
    steps = np.diff(times)
    if len(times) < 3 or (steps >= 0.0).all():
        return ahead
    jumps = np.flatnonzero(np.abs(steps) > 20.0 * np.median(np.abs(steps))) + 1
    runs = np.split(np.arange(len(times)), jumps)
    few = min(10, max(map(len, runs)) - 1)
    following = np.inf
    for run in reversed(runs):
        if len(run) > few:
            following = times[run[0]]
        else:
            ahead[run] = times[run[-1]] >= following
    return ahead


def going_on(times: FloatArray) -> tuple[FloatArray, int]:
    """Return times (n,) that go on a day later where the clock was set back, so that many rows
    follow at times that were before; and how often it was.
    """
    set_back = np.diff(times, prepend=times[:1]) < 0.0
    late = times < np.maximum.accumulate(times)
    count = int(set_back.sum())
    if late.sum() <= 10 * count:
        return times, 0
    return times + DAY * np.cumsum(set_back), count


def times_are_rounded(rows: pd.DataFrame, usual: float) -> bool:
    """Whether an object goes on in the rows of one time, usually so many: to the next time it moves
    by several of the steps in between. Several objects do not, nor several sensors of one.
    """
    step = _median_step(rows, ["time"])
    firsts = rows.groupby("time", as_index=False).first()
    return 1.3 * step < _median_step(firsts.assign(time=0.0), ["time"]) < 2.0 * usual * step


def sorted_rows(table: Table, rows: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of an object in the order of their `time`, those out of order sorted, see
    also `ahead_rows` and `going_on`.
    """
    rows = table.without(rows, rows.time.isna(), "rows without a time")
    ahead = ahead_rows(rows.time.to_numpy())
    rows = table.without(rows, ahead, "rows whose time is after those that follow")
    times, set_back = going_on(rows.time.to_numpy())
    late = int((times < np.maximum.accumulate(times)).sum())
    if set_back:
        table.notes.append(f"{SET_BACK}: {set_back}")
    if late:
        table.notes.append(f"rows out of order, which are sorted: {late}")
    return rows.assign(time=times).sort_values("time", kind="stable")


def rows_of_times(table: Table, rows: pd.DataFrame) -> pd.DataFrame:
    """Return one row for each `time` of sorted rows, the first one. Where many times have several
    rows, and their `x` and `y` show that the times are rounded, the rows are spread over the unit.
    """
    same = rows.groupby("time")
    counts, places = same.x.transform("size"), same.cumcount()
    sizes = counts[places == 0]
    usual = max(sizes.median(), sizes.mean()) if same.ngroups > 2 else 1.0
    if usual > 1.1 and times_are_rounded(rows, usual):
        step = rows.time[places == 0].diff().median()
        # The first rows may be the last ones of their minute.
        places += (usual - counts).clip(0.0) * (rows.time == rows.time.iloc[0])
        table.notes.append(f"several rows at each time are spread over {step:g} s")
        return rows.assign(time=rows.time + step * places / counts.clip(usual))
    axes = rows[["x", "y"]]
    apart = (axes - axes.groupby(rows.time).transform("first")).abs().max(axis=1)
    rows = table.without(rows, apart > 0.0, ELSEWHERE)
    return table.without(rows, rows.time.duplicated(), table.repeats)


def telling_columns(table: Table, rows: pd.DataFrame, used: Collection[int]) -> tuple[int, ...]:
    """Return the column, or the two, that tell apart the objects of a file; none where no more than
    a tenth of the rows repeats a time of its `object`. Times are unique in them, and from row to
    row an object moves by less than the objects are apart at one time.
    """
    known = rows.dropna(subset=["time", "x", "y"])
    repeated = known.duplicated(["object", "time"]).sum()
    if repeated <= 0.1 * len(known):
        return ()
    apart = _median_step(known.sort_values("time", kind="stable"), ["object", "time"])
    cells = table.frame.loc[known.index].drop(columns=[*used])
    few = [k for k in cells if 1 < cells[k].nunique() <= len(known) / 5 and cells[k].notna().all()]
    for columns in (*combinations(few[:10], 1), *combinations(few[:10], 2)):
        marked = known.join(cells[[*columns]]).sort_values("time")
        keys = ["object", *columns]
        unique = marked.duplicated([*keys, "time"]).sum() < 0.1 * repeated
        if unique and _median_step(marked, keys) < apart:
            return columns
    return ()


def _median_step(rows: pd.DataFrame, groups: list[Any]) -> float:
    """Return the median distance of successive rows of each group."""
    steps = rows.groupby(groups)[["x", "y"]].diff()
    return float(np.hypot(steps.x, steps.y).median())


def fill_values(positions: FloatArray) -> BoolArray:
    """Return which rows (n,) have in both coordinates of positions (n, 2) a number such as 0, -1
    or 9999 in place of a position: it is far from the rows before and after.
    """
    fills = np.zeros(len(positions), np.bool_)
    same = positions[:, 0] == positions[:, 1]
    numbers, counts = np.unique(positions[same, 0], return_counts=True)
    steps = np.hypot(*np.diff(positions[~same], axis=0).T)
    steps = steps[~np.isnan(steps)]
    if len(steps) < FEWEST:
        return fills
    longest = 5.0 * np.quantile(steps, 0.95)
    # A number other than 0 is a position if it is there once.
    for number in numbers[counts > (numbers != 0.0)][:100]:
        rows = same & (positions[:, 0] == number)
        borders = np.flatnonzero(np.diff(rows))
        jumps = np.hypot(*(positions[borders + 1] - positions[borders]).T)
        # Next to an empty position there is none.
        jumps = jumps[~np.isnan(jumps)]
        if rows.mean() < 0.5 and len(jumps) and np.median(jumps) > longest:
            fills |= rows
    return fills


def stale_rows(positions: FloatArray) -> IntArray:
    """Return which rows (k,) of positions (n, 2) repeat the last one, where a stale source gives
    most of them several times. Rounded positions, which change by their last digit, are none.
    """
    moved = np.append(True, (np.diff(positions, axis=0) != 0.0).any(axis=1))
    fresh = np.flatnonzero(moved)
    steps = np.abs(np.diff(positions[fresh], axis=0))
    if len(fresh) < FEWEST or np.median(np.diff(fresh)) < 2.0:
        return np.empty(0, int)
    rounded = np.median(np.hypot(*steps.T)) < 5.0 * steps[steps > 0.0].min()
    return np.flatnonzero(~moved & (not rounded))


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


@np.errstate(over="ignore", invalid="ignore")
def jumps_between_places(rows: pd.DataFrame) -> tuple[float, int]:
    """Return how far apart two places are between which an object jumps, as two objects of one name
    do, and how often it does; (0, 0) if it does not. Both places have more than a tenth of the
    sorted rows, and the way between them is ten times faster than others.
    """
    positions, times = rows[["x", "y"]].to_numpy(), rows.time.to_numpy()
    if len(times) < FEWEST or times[0] == times[-1]:
        return 0.0, 0
    along = positions[:, np.ptp(positions, axis=0).argmax()]
    ordered = np.sort(along)
    beyond = along > ordered[np.diff(ordered).argmax()]
    # Several rows may have one time.
    step = np.ptp(times) / len(times)
    of_places = [_speeds(times[at], positions[at], step) for at in (beyond, ~beyond)]
    usual = np.quantile(np.concatenate(of_places), 0.99)
    jumps = int((_speeds(times, positions, step)[np.diff(beyond)] > 10.0 * usual).sum())
    if usual == 0.0 or jumps < 4 or not 0.1 < beyond.mean() < 0.9:
        return 0.0, 0
    distance = np.median(positions[beyond], axis=0) - np.median(positions[~beyond], axis=0)
    return float(np.hypot(*distance)), jumps


def _speeds(times: FloatArray, positions: FloatArray, step: float) -> FloatArray:
    """Return the speeds (n - 1,) between successive positions (n, 2), at least a step apart."""
    lengths: FloatArray = np.hypot(*np.diff(positions, axis=0).T)
    return lengths / np.maximum(np.diff(times), step)


@np.errstate(over="ignore")
def look_like_degrees(times: FloatArray, positions: FloatArray) -> bool:
    """Whether x and y may be degrees: in their range, slow, and far from 0 for their extent."""
    largest, extent = np.abs(positions).max(axis=0), np.ptp(positions, axis=0).max()
    speed = np.median(np.abs(np.diff(positions, axis=0)).max(axis=1) / np.diff(times))
    # Objects move by less than 0.01 degrees in a second, and most of them by more metres. Degrees
    # are twice their extent from 0, and at least one degree.
    far = np.abs(np.median(positions, axis=0)).max() > max(2.0 * extent, 1.0)
    return bool(
        far and extent > 0.0 and speed < 0.01 and largest.max() <= 180.0 and largest.min() <= 90.0
    )


def causes(table: Table, advice: bool = True) -> str:
    """Return what was left out and why; and by option what helps if several objects are taken for
    one.
    """
    reasons = ", ".join(f"{reason} ({len(lines):,})" for reason, lines in table.left_out.items())
    several = "; if rows are of several objects, name their column by --object"
    return reasons + several * (advice and bool({ELSEWHERE, REPEATED} & {*table.left_out}))


def remarks(table: Table) -> list[str]:
    """Return phrases about what was assumed and left out."""
    left_out = f"left out: {causes(table, advice=False)}"
    return [*dict.fromkeys(table.notes)] + [left_out] * bool(table.left_out)


def lost(table: Table) -> int:
    """Return the number of rows left out that should have been measurements."""
    harmless = "blank lines", "headers and comments", STALE
    return sum(len(lines) for reason, lines in table.left_out.items() if reason not in harmless)
