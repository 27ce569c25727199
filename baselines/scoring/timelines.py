"""Statements beside the truth at samples of any spacing: agreement, delay, misses, false
changes.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baselines.scoring.scores import Statistic, quotient, ratio
from baselines.scoring.statements import find_switches
from hybrid_env.checks import BoolArray, FloatArray, IntArray

# In place of a stated mode where nothing is stated.
NOTHING = -1


class Timeline(NamedTuple):
    """What was true and what was stated on one track at T moments, all of shape (T,)."""

    # Increasing, in any unit.
    times: FloatArray
    # True modes.
    modes: IntArray
    # Stated modes, `NOTHING` where nothing is stated.
    stated: IntArray
    # False where the truth is not known.
    scored: BoolArray
    # Time for which a moment stands; 0 where it is not scored.
    weights: FloatArray
    # True at moments that count as samples.
    samples: BoolArray


class TimelineCounts(NamedTuple):
    """Sums over a track or a part of it, from which the figures of any set of tracks follow.
    Switches count if at least half of the moments until the next one are scored, changes if more
    than half are.
    """

    # Time that is scored.
    scored: float
    # Of it, time in which the statement is the true mode.
    agreed: float
    # Of it, time in which the normal mode is true.
    normal: float
    # Number of samples.
    samples: float
    # Number of switches whose mode is stated or missed.
    switches: float
    # Of them, those whose mode is not stated before the next switch.
    missed: float
    # Sum of the times from each other switch to the first right statement.
    delay: float
    # Number of last switches whose mode is not stated before the track ends.
    pending: float
    # Time from any switch to the first right statement, the next switch or the end.
    undetected: float
    # Changes of the statement to a mode that is not true at any moment until the next change.
    false: float
    # Of them, those away from the normal mode while it is true at all of these moments.
    false_alarms: float
    # Changes of the statement.
    changes: float
    # Of the switches, those to the normal mode.
    ends: float
    # Of these, those that are missed.
    missed_ends: float
    # Sum of the delays of the others of these.
    delay_of_ends: float


def statistics(period: float) -> dict[str, Statistic]:
    """Return the figures of a set of tracks by name; NaN where nothing is counted.

    They are: share of the scored time with a right statement; mean delay of the detected switches;
    share of the switches that are missed; mean delay of all switches, where one that is not
    detected counts until the next one or the end of its track; false changes in a period of scored
    time and per 1,000 samples; false alarms in a period of time in the normal mode; changes of the
    statement for each switch. The period has the unit of time.
    """
    return {
        "agreement": ratio("agreed", "scored"),
        "delay": Statistic(
            ("delay", "switches", "missed"),
            lambda delay, all_, missed: quotient(delay, all_ - missed),
        ),
        "misses": ratio("missed", "switches"),
        "full_delay": Statistic(
            ("undetected", "switches", "pending"),
            lambda time, others, pending: quotient(time, others + pending),
        ),
        "false_changes": ratio("false", "scored", period),
        "false_per_1000": ratio("false", "samples", 1000.0),
        "false_alarms": ratio("false_alarms", "normal", period),
        "changes_per_switch": ratio("changes", "switches"),
    }


def count_timeline(
    timeline: Timeline,
    normal: int | None = None,
    blocks: IntArray | None = None,
) -> FloatArray:
    """Return the `TimelineCounts` of B blocks of a track, (B, 15), to which events belong in which
    they begin; `blocks`, (T,), has that of each moment. A false change away from the `normal` mode
    is a false alarm.
    """
    times, modes, stated, scored, weights, samples = timeline
    places = np.zeros(len(times), np.int64) if blocks is None else blocks
    known = np.append(0, np.cumsum(scored))
    right = stated == modes

    def summed(rows: NDArray[np.generic], values: NDArray[np.generic] | None = None) -> FloatArray:
        return np.bincount(places[rows], values, int(places[-1]) + 1).astype(np.float64)

    switched = np.diff(modes, prepend=modes[:1]) != 0
    found = find_switches(switched[:, None], right[:, None])
    counted = 2 * (known[found.end] - known[found.begin]) >= found.end - found.begin
    begin, end, first = (one[counted] for one in (found.begin, found.end, found.stated))
    detected = first < end
    last = end == len(times)
    back = modes[begin] == normal
    waited = np.append(times, times[-1])[np.minimum(first, end)] - times[begin]

    changes = np.flatnonzero((np.diff(stated, prepend=stated[:1]) != 0) & (stated != NOTHING))
    ends = np.append(changes, len(times))[1:]
    certain = 2 * (known[ends] - known[changes]) > ends - changes
    changes, ends = changes[certain], ends[certain]

    def within(flags: BoolArray) -> IntArray:
        """Return the number of flagged moments from each change to the next."""
        total = np.append(0, np.cumsum(flags))
        return np.asarray(total[ends] - total[changes])

    false = within(right) == 0
    quiet = within(modes == normal) == ends - changes
    counts = {
        "scored": summed(scored, weights[scored]),
        "agreed": summed(right, weights[right]),
        "normal": summed(modes == normal, weights[modes == normal]),
        "samples": summed(samples),
        "switches": summed(begin[detected | ~last]),
        "missed": summed(begin[~detected & ~last]),
        "delay": summed(begin[detected], waited[detected]),
        "pending": summed(begin[~detected & last]),
        "undetected": summed(begin, waited),
        "false": summed(changes[false]),
        "false_alarms": summed(changes[false & quiet & (stated[changes] != normal)]),
        "changes": summed(changes),
        "ends": summed(begin[back & (detected | ~last)]),
        "missed_ends": summed(begin[back & ~detected & ~last]),
        "delay_of_ends": summed(begin[back & detected], waited[back & detected]),
    }
    return np.stack([counts[name] for name in TimelineCounts._fields], axis=1)
