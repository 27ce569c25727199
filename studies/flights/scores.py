"""How well statements agree with the labels of flights: agreement, delay, misses, false changes."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from baselines import Scores, Statistic, Timeline, TimelineCounts, count_timeline
from studies.flights.flight import Flight
from studies.flights.labels import Labels, Pair
from studies.flights.turns import STRAIGHT, FloatArray, IntArray

CHANGES = ("switches", "missed", "delay", "ends", "missed_ends", "delay_of_ends")


def quotient(numerator: FloatArray, denominator: FloatArray) -> FloatArray:
    """Return numerator / denominator, NaN where nothing is counted."""
    nothing = np.full(np.shape(numerator), np.nan)
    return np.divide(
        numerator,
        denominator,
        out=nothing,
        where=denominator > 0.0,
    )


STATISTICS = {
    # Share of the scored time.
    "agreement": Statistic(("agreed", "scored"), quotient),
    # Mean time from a change of the label to the first right statement [s], of those detected.
    "delay": Statistic(
        CHANGES[:3],
        lambda n, missed, delay: quotient(delay, n - missed),
    ),
    # Share of the changes of the label.
    "misses": Statistic(("missed", "switches"), quotient),
    # False changes in an hour of scored time.
    "false_per_hour": Statistic(
        ("false", "scored"),
        lambda false, scored: 3600.0 * quotient(false, scored),
    ),
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
    "misses_out": Statistic(("missed_ends", "ends"), quotient),
}


def score_flights(name: str, pairs: Sequence[Pair], stated: Sequence[IntArray]) -> Scores:
    """Return the scores of a decider from statements (n,) on flights with labels, one row of
    `TimelineCounts` for each.
    """
    counts = [count_flight(*pair, modes) for pair, modes in zip(pairs, stated, strict=True)]
    return Scores(
        name,
        "",
        (0.0,),
        TimelineCounts._fields,
        np.array(counts)[..., None],
    )


def count_flight(flight: Flight, labels: Labels, stated: IntArray) -> FloatArray:
    """Return the `TimelineCounts` of the statements (n,) on one flight, over all its pieces."""
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
    return np.asarray(np.sum(counts, axis=(0, 1)))


def value(scores: Scores, name: str = "agreement") -> float:
    """Return a figure of some flights."""
    return float(scores.curve(STATISTICS[name])[0])


def estimates(scores: Scores) -> dict[str, Any]:
    """Return all figures with their intervals by name, as plain values."""
    return {name: scores.estimate(statistic).as_json() for name, statistic in STATISTICS.items()}


def figures(scores: Mapping[str, Scores], name: str, rows: Sequence[int]) -> dict[str, Any]:
    """Return all figures of a decider on some flights, and its agreement less that of the first
    decider, None for that one.
    """
    first = next(iter(scores))
    chosen, reference = scores[name].some(rows), scores[first].some(rows)
    less = None if name == first else chosen.difference(reference, STATISTICS["agreement"])
    return estimates(chosen) | {"agreement_less_first": None if less is None else less.as_json()}


def agreements(
    flights: Sequence[Pair],
    scores: Mapping[str, Scores],
) -> dict[str, dict[str, float]]:
    """Return the agreement of every decider on every flight, by the names of both."""
    return {
        flight.identity: {name: value(of_decider.some([k])) for name, of_decider in scores.items()}
        for k, (flight, _) in enumerate(flights)
    }


def cell(estimate: Mapping[str, Any] | None, digits: int = 1, scale: float = 1.0) -> str:
    """Return an estimate, one of `figures`, with its interval; "-" where nothing is counted."""
    if estimate is None or estimate["value"] is None:
        return "-"
    middle, low, high = (
        f"{scale * estimate[part]:.{digits}f}" for part in ("value", "low", "high")
    )
    return f"{middle} ({low} to {high})"


def write_results(
    folder: Path,
    name: str,
    tables: Mapping[str, pd.DataFrame],
    content: Mapping[str, Any],
) -> None:
    """Print tables with their titles, and write figures as JSON into a folder."""
    for title, table in tables.items():
        print(f"{title}\n{table.to_string(index=False)}\n")
    folder.mkdir(parents=True, exist_ok=True)
    text = json.dumps(content, indent=2)
    (folder / f"{name}.json").write_text(text + "\n", encoding="utf-8")
