"""A timeline of statements beside a timeline of true modes: right ticks, delays, misses, wrong
changes.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from baselines.scoring.scores import Statistic, mean, quotient, ratio
from hybrid_env.checks import BoolArray, FloatArray, IntArray, check_positive, reject

COLUMNS = (
    "right",
    "reward",
    "wrong_changes",
    "stated_changes",
    "switches",
    "delay",
    "detected",
    "missed",
    "undetected",
)
"""Figures of a track: means over ticks, changes to a wrong mode per 1,000 ticks, then sums, see
`StatementMetrics`.
"""

STATISTICS: dict[str, Statistic] = {
    "reward": mean("reward"),
    "right": mean("right"),
    "delay": ratio("delay", "detected"),
    "missed": Statistic(
        ("missed", "detected"),
        lambda missed, detected: quotient(missed, missed + detected),
    ),
    "full_delay": ratio("undetected", "switches"),
    "wrong_changes": mean("wrong_changes"),
    "change_ratio": ratio("stated_changes", "switches"),
}
"""Figures by name: mean reward of a tick; share of right ticks; mean delay of the detected switches
[ticks]; share of missed switches; mean delay of all switches [ticks], where one that is not
detected counts until the end of its segment; wrong changes per 1,000 ticks; changes of the
statement per switch.
"""

# The same of the types of motion: straight, left, right.
TYPE_COLUMNS = tuple(f"type_{name}" for name in COLUMNS)


def _identified(prefix: str) -> dict[str, Statistic]:
    """Return the share of switches whose new mode is named before the next one, and the mean
    delay.
    """
    detected = f"{prefix}detected"
    missed = f"{prefix}missed"
    delay = f"{prefix}delay"
    share = Statistic(
        (detected, missed),
        lambda detected, missed: quotient(detected, missed + detected),
    )
    return {"identified": share, "delay": ratio(delay, detected)}


# Statistics "identified" and "delay" of each.
IDENTIFICATION = {"type": _identified("type_"), "mode": _identified("")}


class Statements(NamedTuple):
    """What was true and what was stated on N tracks of T ticks, (T, N) each."""

    true_modes: IntArray
    stated_modes: IntArray


@dataclass(frozen=True)
class StatementMetrics:
    """Metrics of N tracks of T ticks. A switch is detected if the new mode is stated before the
    next switch, and missed if not; an undetected last switch of a track is neither.
    """

    # (N,) share of ticks with a right statement.
    right: FloatArray
    # (N,) mean reward of a tick.
    reward: FloatArray
    # (N,) changes of the statement to a wrong mode per 1,000 ticks.
    wrong_changes: FloatArray
    # (N,) number of changes of the statement.
    stated_changes: IntArray
    # (N,) number of switches.
    switches: IntArray
    # (D,) ticks from each detected switch to the first right statement, 0 if at its first tick.
    delays: IntArray
    # (D,) track of each delay.
    delay_tracks: IntArray
    # (N,) number of missed switches.
    missed: IntArray
    # (N,) ticks after switches until the new mode is stated, the next switch or the end.
    undetected: IntArray

    @property
    def figures(self) -> FloatArray:
        """Figures of each track, (N, 9), see `COLUMNS`."""
        tracks = len(self.right)
        delay = np.bincount(self.delay_tracks, self.delays, tracks)
        detected = np.bincount(self.delay_tracks, minlength=tracks)
        changes = self.right, self.reward, self.wrong_changes, self.stated_changes, self.switches
        return np.stack([*changes, delay, detected, self.missed, self.undetected], axis=1)

    def value(self, name: str) -> float:
        """Return a figure of all tracks, a key of `STATISTICS`; NaN where nothing was counted."""
        statistic = STATISTICS[name]
        means = self.figures.mean(0)
        return float(
            statistic.function(*(means[COLUMNS.index(column)] for column in statistic.columns))
        )

    def named_within(self, longest: int) -> IntArray:
        """Return how many new modes are stated within 0 .. longest ticks of the switch, and how
        many switches count.
        """
        counts = np.bincount(np.minimum(self.delays, longest + 1), minlength=longest + 2)[:-1]
        return np.append(counts.cumsum(), self.delays.size + self.missed.sum())


def measure_statements(statements: Statements, change_cost: float = 5.0) -> StatementMetrics:
    """Measure recorded statements.

    Args:
        statements: modes of T >= 1 ticks and N >= 1 tracks.
        change_cost: cost of a change to a wrong mode, as in the environment.
    """
    true, stated = (np.asarray(modes) for modes in statements)
    if true.ndim != 2 or true.shape != stated.shape or not true.size:
        raise reject(
            "statements",
            (true.shape, stated.shape),
            "two arrays of the same shape (T, N)",
        )
    change_cost = check_positive("change_cost", change_cost, allow_zero=True)
    right = true == stated
    tracks = true.shape[1]
    changed, switched = (np.diff(modes, axis=0, prepend=modes[:1]) != 0 for modes in (stated, true))
    wrong = changed & ~right
    found = find_switches(switched, right)
    detected = found.stated < found.end
    waited = np.minimum(found.stated, found.end) - found.begin
    missed = np.bincount(found.track[~detected & (found.end < len(true))], minlength=tracks)
    return StatementMetrics(
        right.mean(0),
        (right - change_cost * wrong).mean(0),
        1000.0 * wrong.mean(0),
        changed.sum(0),
        switched.sum(0),
        waited[detected],
        found.track[detected],
        missed,
        np.bincount(found.track, waited, tracks).astype(np.int64),
    )


class Switches(NamedTuple):
    """The switches of N tracks of T ticks, all of shape (S,)."""

    # First tick of the new mode.
    begin: IntArray
    # Tick of the next switch, or T.
    end: IntArray
    # First tick from `begin` on with a right statement, T without one; detected if before `end`.
    stated: IntArray
    # Index of the track.
    track: IntArray


def find_switches(switched: BoolArray, right: BoolArray) -> Switches:
    """Return the switches, and when each is detected, from flags (T, N): new mode begins,
    statement is right.
    """
    ticks, tracks = switched.shape
    times = np.arange(ticks)[:, None]
    # For every tick the next one, itself included, with a right statement, and the next with a
    # switch.
    next_right, next_switch = (
        np.minimum.accumulate(np.where(flags, times, ticks)[::-1], axis=0)[::-1]
        for flags in (right, switched)
    )
    # Of the segment that begins at a switch.
    end = np.vstack([next_switch[1:], np.full((1, tracks), ticks)])
    begin, track = np.nonzero(switched)
    return Switches(begin, end[begin, track], next_right[begin, track], track)
