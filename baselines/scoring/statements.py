"""A timeline of statements beside a timeline of true modes: right ticks, delays, misses, wrong
changes.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from baselines.scoring.scores import Statistic, mean, quotient, ratio
from baselines.scoring.timelines import find_switches
from hybrid_env.checks import FloatArray, IntArray

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


IDENTIFICATION = {
    name: {
        "identified": Statistic(
            (f"{prefix}detected", f"{prefix}missed"),
            lambda detected, missed: quotient(detected, missed + detected),
        ),
        "delay": ratio(f"{prefix}delay", f"{prefix}detected"),
    }
    for name, prefix in (("type", "type_"), ("mode", ""))
}
"""Share of the switches whose new type or mode is named before the next one, and mean delay."""


class Statements(NamedTuple):
    """What was true and what was stated on N tracks of T ticks, (T, N) each."""

    true_modes: IntArray
    stated_modes: IntArray


@dataclass(frozen=True)
class StatementMetrics:
    """Metrics of N tracks of T ticks; for what is detected and missed see `timelines.Switches`."""

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
    right = true == stated
    tracks = true.shape[1]
    changed, switched = (np.diff(modes, axis=0, prepend=modes[:1]) != 0 for modes in (stated, true))
    wrong = changed & ~right
    switches = find_switches(true, stated, np.arange(len(true) + 1))
    waited = switches.waited.astype(int)
    return StatementMetrics(
        right.mean(0),
        (right - change_cost * wrong).mean(0),
        1000.0 * wrong.mean(0),
        changed.sum(0),
        switched.sum(0),
        waited[switches.detected],
        switches.track[switches.detected],
        np.bincount(switches.track[switches.missed], minlength=tracks),
        np.bincount(switches.track, waited, tracks).astype(int),
    )
