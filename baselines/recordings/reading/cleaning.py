"""Rows of an object that are no measurements of their own: they are left out and counted."""

import numpy as np

from baselines.recordings.reading.table import Table
from baselines.recordings.reading.values import DAY
from hybrid_env.checks import BoolArray, FloatArray, IntArray

# Fewer steps do not tell how an object moves.
FEWEST = 20
# Reason of rows that may be of another object.
ELSEWHERE = "repeated times at other places"


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


def times_are_rounded(times: FloatArray, positions: FloatArray) -> bool:
    """Whether rows of one time are about as far apart as others, positions (n, 2)."""
    lengths = np.hypot(*np.diff(positions, axis=0).T)
    known, same = ~np.isnan(lengths), np.diff(times) == 0.0
    within, between = lengths[known & same], lengths[known & ~same]
    return bool(len(within) and len(between) and np.median(within) > 0.3 * np.median(between))


def ordered_rows(
    table: Table,
    seconds: FloatArray,
    rows: IntArray,
    positions: FloatArray | None = None,
    marked: bool = True,
) -> tuple[IntArray, FloatArray]:
    """Return the rows (k,) of an object in the order of their times, and the times.

    Rows out of order are sorted, see also `ahead_rows` and `going_on`. Of rows with one time the
    first is kept. Where most times have several rows, and the positions of the table, (n, 2), show
    that the times are rounded to minutes, ten seconds or seconds, the rows are spread over these.
    `marked`: the rows are known to be of one object.
    """
    rounded = positions is not None and times_are_rounded(seconds[rows], positions[rows])
    times = seconds[rows]
    table.leave_out("rows without a time", table.lines[rows[np.isnan(times)]])
    rows, times = rows[~np.isnan(times)], times[~np.isnan(times)]
    if len(rows) > 1 and (np.diff(times) < 0.0).mean() > 0.5:
        # The newest row is the first one.
        rows, times = rows[::-1], times[::-1]
        table.notes.append("rows sorted from the last to the first")
    ahead = ahead_rows(times)
    table.leave_out("rows whose time is after those that follow", table.lines[rows[ahead]])
    rows = rows[~ahead]
    times, set_back = going_on(times[~ahead])
    late = int((times < np.maximum.accumulate(times)).sum())
    if set_back:
        table.notes.append(
            f"times that the clock was set back, where a new piece begins: {set_back}"
        )
    if late:
        table.notes.append(f"rows out of order, which are sorted: {late}")
    order = np.argsort(times, kind="stable")
    rows, times = rows[order], times[order]
    instants, first, counts = np.unique(times, return_index=True, return_counts=True)
    usual = np.median(counts) if len(counts) > 2 else 1.0
    for unit, word in ((60.0, "minute"), (10.0, "ten seconds"), (1.0, "second")):
        if rounded and usual >= 2.0 and not ((instants - instants[0]) % unit).any():
            places = np.arange(len(times)) - np.repeat(first, counts)
            # The first rows may be the last ones of their minute.
            places[: counts[0]] += max(int(usual) - counts[0], 0)
            table.notes.append(f"several rows in each {word} are spread over it")
            return rows, times + unit * places / np.repeat(np.maximum(counts, usual), counts)
    repeated = np.setdiff1d(np.arange(len(times)), first)
    elsewhere = np.zeros(len(repeated), np.bool_)
    if positions is not None and not marked:
        kept = np.repeat(first, counts)[repeated]
        apart = np.abs(positions[rows[repeated]] - positions[rows[kept]])
        elsewhere = apart.max(axis=1) > 0.0
    table.leave_out("repeated times", table.lines[rows[repeated[~elsewhere]]])
    table.leave_out(ELSEWHERE, table.lines[rows[repeated[elsewhere]]])
    return rows[first], times[first]


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


@np.errstate(over="ignore")
def fresh_rows(times: FloatArray, positions: FloatArray) -> IntArray:
    """Return which rows (k,) have a position of their own. A stale source repeats the last position
    until it has a new one, which is then as far away as a moving object gets in all this time; an
    object that stands still goes on as if no time had passed, and rounded positions change by
    their last digit.
    """
    everything = np.arange(len(times))
    moved = np.append(True, (np.diff(positions, axis=0) != 0.0).any(axis=1))
    fresh = np.flatnonzero(moved)
    if len(fresh) < FEWEST or len(fresh) == len(times):
        return everything
    steps = np.abs(np.diff(positions[fresh], axis=0))
    lengths = np.hypot(*steps.T)
    if np.median(lengths) < 5.0 * steps[steps > 0.0].min():
        return everything
    since_first = np.diff(times[fresh])
    since_last = times[fresh[1:]] - times[fresh[1:] - 1]
    speed = np.median(lengths / since_first)
    stale = lengths > speed * np.sqrt(since_first * since_last)
    # What is said of most repetitions is true of the last one, too.
    runs = np.diff(np.append(fresh, len(times)))
    several = runs[:-1] > 1
    last = several.any() and stale[several].mean() > 0.5
    return np.flatnonzero(moved | ~np.repeat(np.append(stale, last), runs))


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


@np.errstate(over="ignore")
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


def reasons(table: Table) -> str:
    """Return what was left out and why."""
    return ", ".join(f"{reason} ({len(lines):,})" for reason, lines in table.left_out.items())


def causes(table: Table) -> str:
    """Return the reasons, and what helps if they are that several objects are taken for one."""
    several = "; if rows are of several objects, name their column by --object"
    return reasons(table) + several * (ELSEWHERE in table.left_out)


def remarks(table: Table) -> list[str]:
    """Return phrases about what was assumed and left out."""
    return [*dict.fromkeys(table.notes)] + [f"left out: {reasons(table)}"] * bool(table.left_out)


def lost(table: Table) -> int:
    """Return the number of rows left out that should have been measurements."""
    harmless = (
        "lines before the header",
        "lines without numbers below the header",
        "blank lines",
        "comments",
        "repeated headers",
        "repeated times",
        "positions that a stale source repeats",
    )
    return sum(len(lines) for reason, lines in table.left_out.items() if reason not in harmless)
