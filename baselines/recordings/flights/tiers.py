"""Quality tiers of recorded flights, and the flights that are scored by default.

The error of an ADS-B position is small, that of its time is not: with a time that is wrong by e, the position
is wrong by v e along the velocity v. The covariance of a measured position is therefore
R = across^2 I + timing^2 v v'.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Tier(NamedTuple):
    """Quality of recorded flights.

    Attributes:
        name: A to D, or stress.
        across: standard deviation of a position across the velocity [m].
        timing: standard deviation of the time of a position [s].
        text: what the reports are.
    """

    name: str
    across: float
    timing: float
    text: str


TIERS = {
    "A": Tier("A", 1.6, 0.06, "1 s, with the time at which each position was received"),
    "B": Tier("B", 1.7, 0.2, "1 s, state vectors"),
    "C": Tier("C", 4.0, 0.4, "5 s"),
    "D": Tier("D", 6.0, 1.2, "5 to 12 s, resampled before publication; a stress test with weak labels"),
    "stress": Tier(
        "stress", 1.7, 0.2, "1 s, state vectors; flights with special manoeuvres, outside of the totals"
    ),
}

TOGETHER = ("A", "B", "C")
"""Tiers that are also scored together."""

SCORED = {
    "A": (
        "savan:39b415:2", "savan:39b415:9", "savan:39b415:12", "savan:39b415:17", "rega_sg:4b43ac:0",
        "samu31:39ac45:0",
    ),
    "B": (
        "dreamliner_airfrance:3900fb:0", "aircraft_carrier:ae0455:0", "aircraft_carrier:ae0455:2",
        "quickstart:39b002:0", "quickstart:394c13:0", "quickstart:398564:0",
    ),
    "C": (
        "sydney:7c1a89:0", "tour_de_france:3924a4:6", "tour_de_france:3924a4:9", "tour_de_france:3924a4:14",
        "tour_de_france:39cd0b:8",
    ),
    "D": (
        "toulouse:39b415:0", "noumea:7c1a89:0", "ajaccio:39b415:0", "london_gatwick:4076f1:0",
        "lisbon:4070f4:0", "mecsek_mountains:473f9a:0", "pixair_toulouse:39b861:0",
        "texas_longhorn:a7475a:0",
    ),
    # parabolas of weightlessness, demonstration of low approaches, orbits of a tanker
    "stress": ("zero_gravity:38cf9b:0", "belevingsvlucht:484506:0", "inflight_refuelling:3b7777:0"),
}  # fmt: skip
"""Flights that are scored by default."""

RESAMPLED = frozenset(identity.partition(":")[0] for identity in SCORED["D"])
"""Files of which most positions were computed by interpolation."""

STRESSING = frozenset(SCORED["stress"])

SPARSE = ("calfire", "turkish_flag", "elal747", "qantas747", "dreamliner_boeing")
GLIDERS = (
    "alpi_italiane", "alto_adige", "cevennes", "danube_valley", "franconia", "luberon", "oxford_cambridge",
    "sisteron",
)  # fmt: skip
UNUSABLE = frozenset(SPARSE + GLIDERS)
"""Files in which turns cannot be seen. Gliders circle faster than they are reported."""


def tier_of(identity: str, received: bool, times: NDArray[np.float64]) -> Tier:
    """Return the tier of a flight.

    Args:
        identity: `file:icao24:k`.
        received: whether the times at which positions were received are known.
        times: (n,) of its reports [s].
    """
    if identity in STRESSING:
        return TIERS["stress"]
    name = identity.partition(":")[0]
    step = float(np.median(np.diff(times))) if len(times) > 1 else np.inf
    if name in RESAMPLED or step > 6.0:
        return TIERS["D"]
    if step > 2.5:
        return TIERS["C"]
    return TIERS["A" if received else "B"]
