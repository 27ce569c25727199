"""Values of statements at ticks. Delays and misses are those of `timelines`; a wrong change, which
the environment charges, is one to a mode that is not true at its tick.
"""

from dataclasses import dataclass, fields, replace
from typing import NamedTuple

import numpy as np

from baselines.scoring.scores import Statistic, mean, quotient, ratio
from baselines.scoring.timelines import find_switches
from hybrid_env.checks import AnyArray, FloatArray, IntArray

STATISTICS: dict[str, Statistic] = {
    "reward": mean("reward"),
    "right": mean("right"),
    "delay": ratio("delay", "detected"),
    "missed": Statistic(
        ("missed", "detected"), lambda missed, detected: quotient(missed, missed + detected)
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


def of_types(name: str) -> Statistic:
    """Return a figure of the types of the modes, such as left; their columns begin with type_."""
    statistic = STATISTICS[name]
    return replace(statistic, columns=tuple(f"type_{column}" for column in statistic.columns))


class Statements(NamedTuple):
    """What was true and what was stated on N tracks of T ticks, (T, N) each."""

    true_modes: IntArray
    stated_modes: IntArray


@dataclass(frozen=True)
class StatementMetrics:
    """Values of N tracks of T ticks, (N,) each, and delays; for what is detected and missed see
    `timelines.Switches`.
    """

    # (D,) ticks from each detected switch to the first right statement, 0 if at its first tick.
    delays: IntArray
    # Share of ticks with a right statement.
    right: FloatArray
    # Mean reward of a tick.
    reward: FloatArray
    # Changes of the statement to a wrong mode per 1,000 ticks.
    wrong_changes: FloatArray
    # Number of changes of the statement.
    stated_changes: IntArray
    # Number of switches.
    switches: IntArray
    # Sum of the delays.
    delay: AnyArray
    # Number of detected switches.
    detected: IntArray
    # Number of missed switches.
    missed: IntArray
    # Ticks after switches until the new mode is stated, the next switch or the end.
    undetected: AnyArray

    @classmethod
    def columns(cls) -> tuple[str, ...]:
        """Return the names of the values of a track."""
        return tuple(field.name for field in fields(cls))[1:]

    @property
    def values(self) -> FloatArray:
        """Values of each track, (N, F), see `columns`."""
        return np.stack([getattr(self, name) for name in self.columns()], axis=1)

    def value(self, name: str) -> float:
        """Return a value of all tracks, a key of `STATISTICS`; NaN where nothing was counted."""
        statistic = STATISTICS[name]
        return float(statistic.function(*(getattr(self, key).mean() for key in statistic.columns)))


def measure_statements(statements: Statements, change_cost: float = 5.0) -> StatementMetrics:
    """Measure recorded statements.

    Args:
        statements: modes of T >= 1 ticks and N >= 1 tracks.
        change_cost: cost of a change to a wrong mode, as in the environment.
    """
    true, stated = (np.asarray(modes) for modes in statements)
    right = true == stated
    changed = np.diff(stated, axis=0, prepend=stated[:1]) != 0
    wrong = changed & ~right
    track, _, _, detected, missed, waited = find_switches(true, stated, np.arange(len(true) + 1))
    ticks = waited.astype(int)
    tracks = true.shape[1]
    return StatementMetrics(
        delays=ticks[detected],
        right=right.mean(0),
        reward=(right - change_cost * wrong).mean(0),
        wrong_changes=1000.0 * wrong.mean(0),
        stated_changes=changed.sum(0),
        switches=np.bincount(track, minlength=tracks),
        delay=np.bincount(track, detected * ticks, tracks),
        detected=np.bincount(track[detected], minlength=tracks),
        missed=np.bincount(track[missed], minlength=tracks),
        undetected=np.bincount(track, ticks, tracks),
    )
