"""For comparison: the labels of recorded flights themselves, stated one or two positions late."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baselines.recordings.flights.flight import Flight
from baselines.recordings.flights.labels import Labels
from baselines.recordings.flights.metrics import FlightFigures, count_flights, figures

POSITIONS_LATE = (1, 2)


class LateLabels(NamedTuple):
    """Figures on the flights of one tier.

    Attributes:
        tier: name.
        truth: share of the scored time in which the labels of the simulated twins are their true modes.
        late: figures of the labels, stated as many positions late as `POSITIONS_LATE` says.
    """

    tier: str
    truth: float
    late: list[FlightFigures]


def late_figures(
    groups: dict[str, list[int]],
    flights: Sequence[Flight],
    labels: Sequence[Labels],
    twin_labels: Sequence[Labels],
    true_labels: Sequence[Labels],
) -> list[LateLabels]:
    """Return the figures of each tier.

    Args:
        groups: indices of the flights of each tier.
        flights: recorded flights.
        labels: of them.
        twin_labels: of their simulated twins, from the smoother.
        true_labels: the same from the true turn rates.
    """
    truth = count_flights(flights, twin_labels, [one.modes for one in true_labels])
    late = [
        count_flights(flights, labels, [late_modes(*one, count) for one in zip(flights, labels, strict=True)])
        for count in POSITIONS_LATE
    ]
    return [
        LateLabels(
            name,
            figures([truth[k] for k in rows]).agreement,
            [figures([counts[k] for k in rows]) for counts in late],
        )
        for name, rows in groups.items()
    ]


def late_modes(flight: Flight, labels: Labels, count: int) -> NDArray[np.int64]:
    """Return the labels (n,), stated `count` positions late in each piece of the flight."""
    rows = np.arange(len(flight.times))
    for first, end in flight.pieces:
        rows[first:end] = np.maximum(rows[first:end] - count, first)
    return labels.modes[rows]
