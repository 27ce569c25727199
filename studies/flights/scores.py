"""How well statements agree with the labels of flights: agreement, delay, misses, false changes."""

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np
import pandas as pd

from baselines import Estimate, Scores, Statistic, Timeline, TimelineCounts, count_timeline
from studies.flights.labels import Pair
from studies.flights.turns import STRAIGHT, FloatArray, IntArray

CHANGES = ("switches", "missed", "delay", "ends", "missed_ends", "delay_of_ends")


def quotient(numerator: FloatArray, denominator: FloatArray) -> FloatArray:
    """Return numerator / denominator, NaN where nothing is counted."""
    return numerator / np.where(denominator > 0.0, denominator, np.nan)


STATISTICS = {
    # Share of the scored time.
    "agreement": Statistic(("agreed", "scored"), quotient),
    # Mean time from a change of the label to the first right statement [s], of those detected.
    "delay": Statistic(CHANGES[:3], lambda n, missed, delay: quotient(delay, n - missed)),
    # Share of the changes of the label.
    "misses": Statistic(("missed", "switches"), quotient),
    # False changes in an hour of scored time.
    "false_per_hour": Statistic(
        ("false", "scored"), lambda false, scored: 3600.0 * quotient(false, scored)
    ),
    # Delay and share of misses of the changes to turns, and to straight motion.
    "enter": Statistic(CHANGES, lambda n, m, d, ends, me, de: quotient(d - de, n - m - ends + me)),
    "leave": Statistic(CHANGES[3:], lambda ends, missed, delay: quotient(delay, ends - missed)),
    "misses_in": Statistic(CHANGES, lambda n, m, d, ends, me, de: quotient(m - me, n - ends)),
    "misses_out": Statistic(("missed_ends", "ends"), quotient),
}


def score_flights(pairs: Sequence[Pair], stated: Sequence[IntArray]) -> Scores:
    """Return the scores of a decider at K settings from statements (n, K) on flights with labels:
    the sums of `TimelineCounts` over the pieces of each.
    """
    count = stated[0].shape[1]
    totals = np.zeros((len(pairs), len(TimelineCounts._fields), count))
    for k, (flight, labels) in enumerate(pairs):
        for rows, column in product(flight.pieces, range(count)):
            scored = labels.scored[rows]
            timeline = Timeline(
                labels.times[rows],
                labels.modes[rows],
                stated[k][rows, column],
                scored,
                labels.weights[rows],
                scored,
            )
            totals[k, :, column] += count_timeline(timeline, normal=STRAIGHT)[0]
    return Scores("", "", tuple(map(float, range(count))), TimelineCounts._fields, totals)


def value(scores: Scores) -> float:
    """Return the agreement on some flights."""
    return float(scores.curve(STATISTICS["agreement"])[0])


def estimates(scores: Scores) -> dict[str, Any]:
    """Return all statistics with their intervals by name."""
    return {name: scores.estimate(statistic) for name, statistic in STATISTICS.items()}


def estimates_beside_first(
    scores: Mapping[str, Scores], name: str, rows: Sequence[int]
) -> dict[str, Any]:
    """Return all statistics of a decider on some flights, and its agreement and delays less those
    of the first decider, None for that one.
    """
    first = next(iter(scores))
    chosen, reference = scores[name].some(rows), scores[first].some(rows)
    less = {
        f"{compared}_less_first": None
        if name == first
        else chosen.difference(reference, STATISTICS[compared])
        for compared in ("agreement", "enter", "leave")
    }
    return estimates(chosen) | less


def table(title: str, deciders: Mapping[str, Mapping[str, Any]]) -> str:
    """Return a table of all statistics of deciders that are numbers or have an interval."""
    columns: dict[str, dict[str, str]] = {}
    for decider, numbers in deciders.items():
        columns[decider] = {}
        for name, number in numbers.items():
            if isinstance(number, Estimate):
                texts = [f"{part:.3g}" for part in vars(number).values()]
                columns[decider][name] = "{} ({} to {})".format(*texts)
            elif isinstance(number, float):
                columns[decider][name] = f"{number:.3g}"
    return f"{title}\n{pd.DataFrame(columns).fillna('').to_string()}\n"
