"""A recorded flight: measured positions in metres, the aircraft's own track angle, and its tier of
quality. The error of an ADS-B position is small, that of its time is not: with a time that is wrong
by e, the position is wrong by v e along the velocity v. The covariance of a measured position is
therefore R = across^2 I + timing^2 v v'.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from pyproj import Proj

from hybrid_env import ArgumentError
from studies.flights.turns import Batch, FloatArray

# A position that is closer to the line between its neighbours [deg] was computed by interpolation.
ON_A_LINE = 2e-8
# Positions of a flight.
FEWEST = 50

# A flight is divided where two positions are further apart in time [s]. Filters begin anew.
LONGEST_STEP = 60.0
# Positions.
NO_CUT = 2**31
# [s]
CLIMB_TIME, SHORTEST_CLIMB = 5.0, 1.0
# Positions; shorter ones are not used.
SHORTEST_PIECE = 20


class Tier(NamedTuple):
    """Quality of recorded flights."""

    # A to D, or stress.
    name: str
    # Standard deviation of a position across the velocity [m].
    across: float
    # Standard deviation of the time of a position [s].
    timing: float


TIERS = {
    # 1 s, with the time at which each position was received.
    "A": Tier("A", 1.6, 0.06),
    # 1 s, state vectors.
    "B": Tier("B", 1.7, 0.2),
    # 5 s.
    "C": Tier("C", 4.0, 0.4),
    # 5 to 12 s, resampled before publication; a stress test with weak labels.
    "D": Tier("D", 6.0, 1.2),
    # 1 s, state vectors; special manoeuvres, outside of the totals.
    "stress": Tier("stress", 1.7, 0.2),
}

# Tiers that are also scored together.
TOGETHER = ("A", "B", "C")

# Flights that are scored by default.
SCORED = {
    "A": (
        "savan:39b415:2",
        "savan:39b415:9",
        "savan:39b415:12",
        "savan:39b415:17",
        "rega_sg:4b43ac:0",
        "samu31:39ac45:0",
    ),
    "B": (
        "dreamliner_airfrance:3900fb:0",
        "aircraft_carrier:ae0455:0",
        "aircraft_carrier:ae0455:2",
        "quickstart:39b002:0",
        "quickstart:394c13:0",
        "quickstart:398564:0",
    ),
    "C": (
        "sydney:7c1a89:0",
        "tour_de_france:3924a4:6",
        "tour_de_france:3924a4:9",
        "tour_de_france:3924a4:14",
        "tour_de_france:39cd0b:8",
    ),
    "D": (
        "toulouse:39b415:0",
        "noumea:7c1a89:0",
        "ajaccio:39b415:0",
        "london_gatwick:4076f1:0",
        "lisbon:4070f4:0",
        "mecsek_mountains:473f9a:0",
        "pixair_toulouse:39b861:0",
        "texas_longhorn:a7475a:0",
    ),
    # Parabolas of weightlessness, demonstration of low approaches, orbits of a tanker.
    "stress": ("zero_gravity:38cf9b:0", "belevingsvlucht:484506:0", "inflight_refuelling:3b7777:0"),
}
# Files of which most positions were computed by interpolation.
RESAMPLED = frozenset(identity.partition(":")[0] for identity in SCORED["D"])
STRESSING = frozenset(SCORED["stress"])

# Files in which turns cannot be seen. The gliders of the second and third line circle faster than
# they are reported.
UNUSABLE = {
    "calfire",
    "turkish_flag",
    "elal747",
    "qantas747",
    "dreamliner_boeing",
    "alpi_italiane",
    "alto_adige",
    "cevennes",
    "danube_valley",
    "franconia",
    "luberon",
    "oxford_cambridge",
    "sisteron",
}


@dataclass(frozen=True, eq=False)
class Flight:
    """Positions of one flight."""

    # `file:icao24:k`
    identity: str
    tier: Tier
    # (n,) strictly increasing, from 0 [s]
    times: FloatArray
    # (n, 2) x east and y north [m]
    positions: FloatArray
    # (n,) the aircraft's own track angle, anticlockwise from east [rad], NaN where not reported.
    tracks: FloatArray
    # (n,) [m]
    altitudes: FloatArray | None = None

    @property
    def hours(self) -> float:
        """Duration [h]."""
        return float(self.times[-1] - self.times[0]) / 3600.0

    @property
    def climbs(self) -> FloatArray:
        """(n,) climb rate in the last 5 s, or since the position before if that is longer ago
        [m/s].
        """
        if self.altitudes is None:
            return np.zeros(len(self.times))
        rows = np.arange(len(self.times))
        before = np.minimum(
            np.searchsorted(self.times, self.times - CLIMB_TIME),
            np.maximum(rows - 1, 0),
        )
        passed = np.maximum(self.times - self.times[before], SHORTEST_CLIMB)
        return np.asarray((self.altitudes - self.altitudes[before]) / passed)

    @property
    def pieces(self) -> list[tuple[int, int]]:
        """First row and end of the pieces between gaps of more than a minute, of at least 20
        positions.
        """
        cuts = np.flatnonzero(np.diff(self.times) > LONGEST_STEP) + 1
        borders = [0, *cuts.tolist(), len(self.times)]
        return [(a, b) for a, b in pairwise(borders) if b - a >= SHORTEST_PIECE]


def clean_flight(
    identity: str,
    tier: Tier,
    times: FloatArray,
    latitudes: FloatArray,
    longitudes: FloatArray,
    angles: FloatArray,
) -> Flight:
    """Return a flight of reports in any order, without repeated and interpolated positions: times
    (n,) [s], latitudes, longitudes (n,) and track angles (n,), clockwise from north [deg], NaN
    where not reported; at least 50 must remain.
    """
    known = np.flatnonzero(~np.isnan(times + latitudes + longitudes))
    known = known[np.argsort(times[known], kind="stable")]
    changed = np.ones(len(known), np.bool_)
    changed[1:] = (np.diff(latitudes[known]) != 0.0) | (np.diff(longitudes[known]) != 0.0)
    moved = known[changed]
    # Two positions with one time: the first remains.
    moved = moved[np.diff(times[moved], prepend=-np.inf) > 0.0]
    share = (times[moved][1:-1] - times[moved][:-2]) / (times[moved][2:] - times[moved][:-2])
    off = [
        np.abs(values[1:-1] - (1.0 - share) * values[:-2] - share * values[2:])
        for values in (latitudes[moved], longitudes[moved])
    ]
    rows = np.delete(
        moved,
        1 + np.flatnonzero(np.maximum(*off) < ON_A_LINE),
    )
    if len(rows) < FEWEST:
        raise ArgumentError(
            f"flight {identity} has {len(rows)} positions: expected at least {FEWEST}"
        )
    return Flight(
        identity,
        tier,
        times[rows] - times[rows[0]],
        on_plane(latitudes[rows], longitudes[rows]),
        np.radians(90.0 - angles[rows]),
    )


def on_plane(latitudes: FloatArray, longitudes: FloatArray) -> FloatArray:
    """Return x east and y north [m], (n, 2), of latitudes and longitudes (n,) [deg]: the azimuthal
    equidistant projection about their middle.
    """
    unwrapped = np.unwrap(longitudes, period=360.0)
    latitude, longitude = (
        round(float(values.min() + values.max()) / 2.0, 6) for values in (latitudes, unwrapped)
    )
    plane = Proj(
        proj="aeqd",
        lat_0=latitude,
        lon_0=longitude,
        ellps="WGS84",
    )
    return np.transpose(plane(longitudes, latitudes))


def stack_flights(flights: Sequence[Flight], longest: int = NO_CUT, margin: int = 0) -> Batch:
    """Return the pieces of flights as one batch, cut into parts of at most `longest` positions;
    `margin` positions before and after a part are filtered too, so that it is as without the cut.
    """
    parts = [
        (
            k,
            max(begin - margin, first),
            min(begin + longest + margin, end),
            (begin, min(begin + longest, end)),
        )
        for k, flight in enumerate(flights)
        for first, end in flight.pieces
        for begin in range(first, end, longest)
    ]
    pieces = tuple(part[:3] for part in parts)
    total = max(end - first for _, first, end in pieces)
    times = np.empty((total, len(pieces)))
    positions = np.full((total, len(pieces), 2), np.nan)
    climbs, rates = np.zeros_like(times), [flight.climbs for flight in flights]
    for column, (k, first, end) in enumerate(pieces):
        count = end - first
        times[:count, column], times[count:, column] = (
            flights[k].times[first:end],
            flights[k].times[end - 1],
        )
        positions[:count, column] = flights[k].positions[first:end]
        climbs[:count, column] = rates[k][first:end]
    tiers = [flights[k].tier for k, _, _ in pieces]
    across, timing = np.array([[one.across, one.timing] for one in tiers]).T
    return Batch(pieces, times, positions, across, timing, climbs, tuple(part[3] for part in parts))


def tier_of(identity: str, received: bool, times: FloatArray) -> Tier:
    """Return the tier of a flight with reports at times (n,) [s]; `received`: they are those of
    reception.
    """
    if identity in STRESSING:
        return TIERS["stress"]
    step = float(np.median(np.diff(times))) if len(times) > 1 else np.inf
    if identity.partition(":")[0] in RESAMPLED or step > 6.0:
        return TIERS["D"]
    return TIERS["C" if step > 2.5 else "A" if received else "B"]
