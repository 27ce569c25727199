"""Statements beside the truth at samples of any spacing: agreement, delay, misses, false
changes.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baselines.scoring.scores import Statistic, quotient, ratio
from hybrid_env.checks import AnyArray, BoolArray, FloatArray, IntArray

# In place of the index of a mode where none is declared or stated.
NO_MODE = -1


class Timeline(NamedTuple):
    """What was true and what was stated on one track at T moments, all of shape (T,)."""

    # Increasing, in any unit.
    times: FloatArray
    # True modes.
    modes: IntArray
    # Stated modes, `NO_MODE` where nothing is stated.
    stated: IntArray
    # False where the truth is not known.
    scored: BoolArray
    # Time for which a moment stands; 0 where it is not scored.
    weights: FloatArray
    # True at moments that count as samples.
    samples: BoolArray


class Switches(NamedTuple):
    """The S switches of the true mode on N tracks of T moments, (S,) each."""

    # Index of the track.
    track: IntArray
    # First moment of the new mode.
    begin: IntArray
    # Moment of the next switch, or T.
    end: IntArray
    # The new mode is stated before the next switch, or the end of the track.
    detected: BoolArray
    # Not detected, and there is a next switch; an undetected last switch is neither.
    missed: BoolArray
    # Time until the first right statement, the next switch or the end of the track.
    waited: FloatArray


def find_switches(modes: IntArray, stated: IntArray, times: AnyArray) -> Switches:
    """Return the switches of true modes (T, N), and when statements (T, N) follow them. times: (T +
    1,) of the moments and of the end, in any unit; ticks are times, too.
    """
    T = len(modes)
    track, before = np.nonzero(np.diff(modes, axis=0).T)
    begin = before + 1
    # The last switch of a track lasts until its end.
    end = np.where(np.diff(track, append=-1) == 0, np.roll(begin, -1), T)
    # For every moment the next one, itself included, with a right statement.
    right = np.where(stated == modes, np.arange(T)[:, None], T)
    first = np.minimum.accumulate(right[::-1], axis=0)[::-1][begin, track]
    detected = first < end
    waited = times[np.minimum(first, end)] - times[begin]
    return Switches(track, begin, end, detected, ~detected & (end < T), waited)


class TimelineCounts(NamedTuple):
    """Sums over B parts of a track, (B,) each, from which the values of any set of tracks follow.
    Switches count if at least half of the moments until the next one are scored, changes if more
    than half are.
    """

    # Time that is scored.
    scored: FloatArray
    # Scored time in which the statement is the true mode.
    agreed: FloatArray
    # Scored time in which the normal mode is true.
    normal: FloatArray
    # Number of samples.
    samples: FloatArray
    # Number of switches whose mode is stated or missed.
    switches: FloatArray
    # Switches whose mode is not stated before the next switch.
    missed: FloatArray
    # Sum of the times from each other switch to the first right statement.
    delay: FloatArray
    # Number of last switches whose mode is not stated before the track ends.
    pending: FloatArray
    # Time from any switch to the first right statement, the next switch or the end.
    undetected: FloatArray
    # Changes of the statement to a mode that is not true at any moment until the next change.
    false: FloatArray
    # False changes away from the normal mode while it is true at all of these moments.
    false_alarms: FloatArray
    # Changes of the statement.
    changes: FloatArray
    # Switches to the normal mode.
    ends: FloatArray
    # Missed switches to the normal mode.
    missed_ends: FloatArray
    # Sum of the delays of the others of these.
    delay_of_ends: FloatArray


def statistics(period: float) -> dict[str, Statistic]:
    """Return the values of a set of tracks by name; NaN where nothing is counted.

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
    timeline: Timeline, normal: int | None = None, blocks: IntArray | None = None
) -> FloatArray:
    """Return the `TimelineCounts` of B blocks of a track, (B, 15), to which events belong in which
    they begin; `blocks`, (T,), has that of each moment. A false change away from the `normal` mode
    is a false alarm.
    """
    times, modes, stated, scored, weights, samples = timeline
    places = np.zeros(len(times), int) if blocks is None else blocks
    known = np.append(0, np.cumsum(scored))
    right = stated == modes

    def summed(rows: NDArray[np.generic], values: NDArray[np.generic] | None = None) -> FloatArray:
        return np.bincount(places[rows], values, int(places[-1]) + 1).astype(float)

    switches = find_switches(modes[:, None], stated[:, None], np.append(times, times[-1]))
    enough = 2 * (known[switches.end] - known[switches.begin]) >= switches.end - switches.begin
    _, begin, _, detected, missed, waited = (values[enough] for values in switches)
    counted = detected | missed
    back = modes[begin] == normal

    changes = np.flatnonzero((np.diff(stated, prepend=stated[:1]) != 0) & (stated != NO_MODE))
    ends = np.append(changes, len(times))[1:]
    certain = 2 * (known[ends] - known[changes]) > ends - changes
    changes = changes[certain]
    ends = ends[certain]

    def within(flags: BoolArray) -> IntArray:
        """Return the number of flagged moments from each change to the next."""
        total = np.append(0, np.cumsum(flags))
        return total[ends] - total[changes]

    false = within(right) == 0
    quiet = within(modes == normal) == ends - changes
    counts = TimelineCounts(
        scored=summed(scored, weights[scored]),
        agreed=summed(right, weights[right]),
        normal=summed(modes == normal, weights[modes == normal]),
        samples=summed(samples),
        switches=summed(begin[counted]),
        missed=summed(begin[missed]),
        delay=summed(begin[detected], waited[detected]),
        pending=summed(begin[~counted]),
        undetected=summed(begin, waited),
        false=summed(changes[false]),
        false_alarms=summed(changes[false & quiet & (stated[changes] != normal)]),
        changes=summed(changes),
        ends=summed(begin[back & counted]),
        missed_ends=summed(begin[back & missed]),
        delay_of_ends=summed(begin[back & detected], waited[back & detected]),
    )
    return np.stack(counts, axis=1)
