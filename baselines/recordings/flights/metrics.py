"""How well statements agree with the labels of flights: agreement, delay, misses, false changes."""

from collections.abc import Sequence

import numpy as np

from baselines.estimation.turns import STRAIGHT
from baselines.recordings.flights.flight import Flight
from baselines.recordings.flights.labels import Labels
from baselines.scoring.scores import Scores, Statistic, quotient, ratio
from baselines.scoring.timelines import Timeline, TimelineCounts, count_timeline, statistics
from hybrid_env.checks import IntArray

_COMMON = statistics(3600.0)
_ENDS = ("switches", "missed", "delay", "ends", "missed_ends", "delay_of_ends")
# Figures of a set of flights: share of the scored time; mean delay of the detected changes [s];
# share of the changes of the label that are missed; false changes in an hour of scored time; of
# them, those to a turn in straight motion; changes of the statement for each change of the label;
# delay and share of misses of the changes to turns (enter, in) and to straight motion (leave, out).
# NaN where nothing is counted.
STATISTICS: dict[str, Statistic] = {
    "agreement": _COMMON["agreement"],
    "delay": _COMMON["delay"],
    "misses": _COMMON["misses"],
    "false_per_hour": _COMMON["false_changes"],
    "false_turns_per_hour": ratio("false_alarms", "scored", 3600.0),
    "changes_per_label": _COMMON["changes_per_switch"],
    "enter": Statistic(_ENDS, lambda n, m, d, ends, me, de: quotient(d - de, n - m - ends + me)),
    "leave": Statistic(_ENDS[3:], lambda ends, missed, delay: quotient(delay, ends - missed)),
    "misses_in": Statistic(_ENDS, lambda n, m, d, ends, me, de: quotient(m - me, n - ends)),
    "misses_out": ratio("missed_ends", "ends"),
}


def score_flights(
    name: str,
    flights: Sequence[Flight],
    labels: Sequence[Labels],
    stated: Sequence[IntArray],
) -> Scores:
    """Return the scores of a decider from statements (n,) on flights, one row of
    `TimelineCounts` for each.
    """
    counts = [count_flight(*one) for one in zip(flights, labels, stated, strict=True)]
    return Scores(name, "", (0.0,), TimelineCounts._fields, np.array(counts)[..., None])


def count_flight(flight: Flight, labels: Labels, stated: IntArray) -> TimelineCounts:
    """Compare the statements of one flight, (n,), with its labels, in each of its pieces."""
    counts = []
    for piece in flight.pieces:
        rows = slice(*piece)
        scored = labels.scored[rows]
        track = Timeline(
            labels.times[rows],
            labels.modes[rows],
            stated[rows],
            scored,
            labels.weights[rows],
            scored,
        )
        counts.append(count_timeline(track, normal=STRAIGHT))
    return TimelineCounts(*np.sum(counts, axis=(0, 1)).tolist())
