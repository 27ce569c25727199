"""How well statements agree with the labels of flights: agreement, delay, misses, false changes."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baselines.recordings.flights.batch import Batch
from baselines.recordings.flights.flight import Flight
from baselines.recordings.flights.labels import STRAIGHT, Labels

IntArray = NDArray[np.int64]

DRAWS = 2000  # of the bootstrap


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


class FlightFigures(NamedTuple):
    """Figures of a set of flights: NaN where nothing is counted.

    Attributes:
        agreement: share of the scored time.
        delay: mean delay of the detected changes [s].
        misses: share of the changes of the label that are missed.
        false_per_hour: false changes in an hour of scored time.
        false_turns_per_hour: of them, those to a turn in straight motion.
        changes_per_label: changes of the statement for each change of the label.
    """

    agreement: float
    delay: float
    misses: float
    false_per_hour: float
    false_turns_per_hour: float
    changes_per_label: float


def count_flight(labels: Labels, stated: IntArray, pieces: Sequence[tuple[int, int]]) -> FlightCounts:
    """Compare the statements of one flight, (n,), with its labels, in each of its pieces."""
    total = FlightCounts(0.0, 0.0, 0, 0, 0.0, 0, 0, 0)
    for first, end in pieces:
        rows = slice(first, end)
        part = _count_piece(
            labels.times[rows], labels.modes[rows], labels.scored[rows], labels.weights[rows], stated[rows]
        )
        total = FlightCounts._make(a + b for a, b in zip(total, part, strict=True))
    return total


def count_flights(
    flights: Sequence[Flight], labels: Sequence[Labels], stated: Sequence[IntArray]
) -> list[FlightCounts]:
    """Compare the statements of each flight with its labels."""
    return [
        count_flight(label, modes, flight.pieces)
        for flight, label, modes in zip(flights, labels, stated, strict=True)
    ]


def _count_piece(
    times: NDArray[np.float64],
    modes: IntArray,
    scored: NDArray[np.bool_],
    weights: NDArray[np.float64],
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
    changed: NDArray[np.bool_],
    right: NDArray[np.bool_],
    scored: NDArray[np.bool_],
    false_turn: NDArray[np.bool_],
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


def figures(counts: Sequence[FlightCounts]) -> FlightFigures:
    """Return the figures of flights."""
    return FlightFigures(*(float(one) for one in _figures(np.array(counts, np.float64).sum(0))))


def bootstrap(counts: Sequence[FlightCounts]) -> dict[str, tuple[float, float]]:
    """Return a 95 % interval of each figure: flights are drawn with replacement (Efron 1979)."""
    drawn = _figures(_drawn(counts))
    return {name: _interval(one) for name, one in zip(FlightFigures._fields, drawn, strict=True)}


def paired_agreement(
    counts: Sequence[FlightCounts], others: Sequence[FlightCounts]
) -> tuple[float, tuple[float, float]]:
    """Return the agreement less that of others on the same flights, and its interval as in `bootstrap`."""
    drawn = _figures(_drawn(counts))[0] - _figures(_drawn(others))[0]
    return figures(counts).agreement - figures(others).agreement, _interval(drawn)


def _drawn(counts: Sequence[FlightCounts]) -> NDArray[np.float64]:
    """Return sums (fields, draws) over as many flights, drawn with replacement; always the same draws."""
    values = np.array(counts, np.float64)
    chosen = np.random.default_rng(0).integers(len(values), size=(DRAWS, len(values)))
    return np.asarray(values[chosen].sum(1).T)


def _interval(values: NDArray[np.float64]) -> tuple[float, float]:
    """Return the 95 % interval of drawn values, NaN if all are."""
    if np.isnan(values).all():
        return float("nan"), float("nan")
    low, high = np.nanquantile(values, (0.025, 0.975))
    return float(low), float(high)


def _figures(sums: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    scored, agreed, labels, missed, delay, false, false_turns, changes = sums

    def over(part: NDArray[np.float64], whole: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.where(whole > 0.0, part / np.where(whole > 0.0, whole, 1.0), np.nan)

    return [
        over(agreed, scored),
        over(delay, labels - missed),
        over(missed, labels),
        over(3600.0 * false, scored),
        over(3600.0 * false_turns, scored),
        over(changes, labels),
    ]


def unstack(batch: Batch, values: IntArray, lengths: Sequence[int]) -> list[IntArray]:
    """Return values (T, B) of the pieces as one array (n,) of each flight; 0 outside of the pieces."""
    flights = [np.zeros(length, values.dtype) for length in lengths]
    for column, (k, first, end) in enumerate(batch.pieces):
        flights[k][first:end] = values[: end - first, column]
    return flights
