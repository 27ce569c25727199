"""How well statements agree with the labels of flights: agreement, delay, misses, false changes."""

from collections.abc import Sequence

import numpy as np

from baselines import Scores, Statistic, Timeline, TimelineCounts, count_timeline
from studies.flights.flight import Flight
from studies.flights.labels import Labels
from studies.flights.turns import STRAIGHT, FloatArray, IntArray

HOUR = 3600.0
CHANGES = ("switches", "missed", "delay", "ends", "missed_ends", "delay_of_ends")


def quotient(numerator: FloatArray, denominator: FloatArray) -> FloatArray:
    """Return numerator / denominator, NaN where nothing is counted."""
    nothing = np.full(np.shape(numerator), np.nan)
    return np.divide(numerator, denominator, out=nothing, where=denominator > 0.0)


def ratio(numerator: str, denominator: str, factor: float = 1.0) -> Statistic:
    """Return the quotient of two sums, times a factor."""
    return Statistic((numerator, denominator), lambda a, b: factor * quotient(a, b))


STATISTICS = {
    # Share of the scored time.
    "agreement": ratio("agreed", "scored"),
    # Mean time from a change of the label to the first right statement [s], of those detected.
    "delay": Statistic(
        ("delay", "switches", "missed"),
        lambda delay, changes, missed: quotient(delay, changes - missed),
    ),
    # Share of the changes of the label.
    "misses": ratio("missed", "switches"),
    # False changes in an hour of scored time, and those of them to a turn in straight motion.
    "false_per_hour": ratio("false", "scored", HOUR),
    "false_turns_per_hour": ratio("false_alarms", "scored", HOUR),
    "changes_per_label": ratio("changes", "switches"),
    # Delay and share of misses of the changes to turns, and to straight motion.
    "enter": Statistic(
        CHANGES,
        lambda n, m, d, ends, me, de: quotient(d - de, n - m - ends + me),
    ),
    "leave": Statistic(
        CHANGES[3:],
        lambda ends, missed, delay: quotient(delay, ends - missed),
    ),
    "misses_in": Statistic(
        CHANGES,
        lambda n, m, d, ends, me, de: quotient(m - me, n - ends),
    ),
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
