"""How well statements agree with the labels of flights: agreement, delay, misses, false changes."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from baselines.estimation.turns import STRAIGHT
from baselines.recordings.flights.flight import Flight
from baselines.recordings.flights.labels import Labels
from baselines.scoring.scores import Scores, Statistic, quotient, ratio
from hybrid_env.checks import BoolArray, FloatArray, IntArray


class FlightCounts(NamedTuple):
    """Sums over one flight, from which the figures of any set of flights follow.

    Attributes:
        scored: time that is scored [s].
        agreed: of it, time in which the statement is the label [s].
        labels: number of changes of the label that are counted: those after which at least half of the time
            is scored, and their mode is stated or missed.
        missed: of them, those whose mode is not stated before the next one.
        delay: sum of the times from each other change to the first right statement [s].
        false: changes of the statement to a mode that is not the label in any row until the next change.
        false_turns: of them, those to a turn while the label is straight motion in all of these rows.
        changes: changes of the statement. Of all three, those are counted after which more than half of the
            rows until the next change are scored.
    """

    scored: float
    agreed: float
    labels: int
    missed: int
    delay: float
    false: int
    false_turns: int
    changes: int


STATISTICS: dict[str, Statistic] = {
    "agreement": ratio("agreed", "scored"),
    "delay": Statistic(
        ("delay", "labels", "missed"), lambda delay, labels, missed: quotient(delay, labels - missed)
    ),
    "misses": ratio("missed", "labels"),
    "false_per_hour": ratio("false", "scored", 3600.0),
    "false_turns_per_hour": ratio("false_turns", "scored", 3600.0),
    "changes_per_label": ratio("changes", "labels"),
}
"""Figures of a set of flights: share of the scored time; mean delay of the detected changes [s]; share of the
changes of the label that are missed; false changes in an hour of scored time; of them, those to a turn in
straight motion; changes of the statement for each change of the label. NaN where nothing is counted."""


def score_flights(
    name: str, flights: Sequence[Flight], labels: Sequence[Labels], stated: Sequence[IntArray]
) -> Scores:
    """Return the scores of a decider, whose figures are those of `FlightCounts`, one row for each flight.

    Args:
        name: of the decider.
        flights: the flights.
        labels: of each flight.
        stated: (n,) statements on each flight.
    """
    counts = [count_flight(*one) for one in zip(flights, labels, stated, strict=True)]
    return Scores(name, "", (0.0,), FlightCounts._fields, np.array(counts, np.float64)[..., None])


def count_flight(flight: Flight, labels: Labels, stated: IntArray) -> FlightCounts:
    """Compare the statements of one flight, (n,), with its labels, in each of its pieces."""
    total = FlightCounts(0.0, 0.0, 0, 0, 0.0, 0, 0, 0)
    for first, end in flight.pieces:
        rows = slice(first, end)
        part = _count_piece(
            labels.times[rows], labels.modes[rows], labels.scored[rows], labels.weights[rows], stated[rows]
        )
        total = FlightCounts._make(a + b for a, b in zip(total, part, strict=True))
    return total


def _count_piece(
    times: FloatArray,
    modes: IntArray,
    scored: BoolArray,
    weights: FloatArray,
    stated: IntArray,
) -> FlightCounts:
    right = stated == modes
    changed = np.diff(stated, prepend=stated[:1]) != 0
    begins = np.flatnonzero(np.diff(modes) != 0) + 1
    ends = np.append(begins, len(modes))[1:]
    labels = missed = 0
    delay = 0.0
    for begin, end in zip(begins.tolist(), ends.tolist(), strict=True):
        if scored[begin:end].mean() < 0.5:
            continue
        found = np.flatnonzero(right[begin:end])
        if not found.size and end == len(modes):
            continue  # the piece ends before the change could be detected
        labels += 1
        if found.size:
            delay += float(times[begin + found[0]] - times[begin])
        else:
            missed += 1
    return FlightCounts(
        float(weights.sum()), float(weights[right].sum()), labels, missed, delay,
        *_count_changes(changed, right, scored, (stated != STRAIGHT) & (modes == STRAIGHT)),
    )  # fmt: skip


def _count_changes(
    changed: BoolArray,
    right: BoolArray,
    scored: BoolArray,
    false_turn: BoolArray,
) -> tuple[int, int, int]:
    """Return the false changes, those of them to a turn in straight motion, and all changes."""
    begins = np.flatnonzero(changed)
    if not begins.size:
        return 0, 0, 0
    rows = np.append(begins, len(changed))[1:] - begins
    ever_right, certain, turning = (
        np.add.reduceat(flags.astype(np.int64), begins) for flags in (right, scored, false_turn)
    )
    counted = 2 * certain > rows
    false = counted & (ever_right == 0)
    return int(false.sum()), int((false & (turning == rows)).sum()), int(counted.sum())
