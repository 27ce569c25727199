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
import pandas as pd
from pyproj import Proj

from hybrid_env import ArgumentError
from studies.flights.turns import Batch, FloatArray

LONGEST_STEP = 60.0
"""A flight is divided where two positions are further apart in time [s]. Filters begin anew."""


class Tier(NamedTuple):
    """Quality of recorded flights."""

    # A to D, or stress.
    name: str
    # Standard deviation of a position across the velocity [m].
    across: float
    # Standard deviation of the time of a position [s].
    timing: float


TIERS = {
    tier.name: tier
    for tier in (
        # 1 s, with the time at which each position was received.
        Tier("A", 1.6, 0.06),
        # 1 s, state vectors.
        Tier("B", 1.7, 0.2),
        # 5 s.
        Tier("C", 4.0, 0.4),
        # 5 to 12 s, resampled before publication; a stress test with weak labels.
        Tier("D", 6.0, 1.2),
        # 1 s, state vectors; special manoeuvres, outside of the totals.
        Tier("stress", 1.7, 0.2),
    )
}

SCORED = {
    "A": "savan:39b415:2 savan:39b415:9 savan:39b415:12 savan:39b415:17 rega_sg:4b43ac:0"
    " samu31:39ac45:0",
    "B": "dreamliner_airfrance:3900fb:0 aircraft_carrier:ae0455:0 aircraft_carrier:ae0455:2"
    " quickstart:39b002:0 quickstart:394c13:0 quickstart:398564:0",
    "C": "sydney:7c1a89:0 tour_de_france:3924a4:6 tour_de_france:3924a4:9"
    " tour_de_france:3924a4:14 tour_de_france:39cd0b:8",
    "D": "toulouse:39b415:0 noumea:7c1a89:0 ajaccio:39b415:0 london_gatwick:4076f1:0"
    " lisbon:4070f4:0 mecsek_mountains:473f9a:0 pixair_toulouse:39b861:0 texas_longhorn:a7475a:0",
    # Parabolas of weightlessness, demonstration of low approaches, orbits of a tanker.
    "stress": "zero_gravity:38cf9b:0 belevingsvlucht:484506:0 inflight_refuelling:3b7777:0",
}
"""Flights that are scored by default. No other files have usable turns: in those of gliders the
circles are faster than the reports."""


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
    def climbs(self) -> FloatArray:
        """(n,) climb rate in the last 5 s, or since the position before if that is longer ago
        [m/s].
        """
        if self.altitudes is None:
            return np.zeros(len(self.times))
        last = np.maximum(
            np.arange(len(self.times)) - 1,
            0,
        )
        before = np.minimum(
            np.searchsorted(self.times, self.times - 5.0),
            last,
        )
        passed = np.maximum(
            self.times - self.times[before],
            1.0,
        )
        return np.asarray((self.altitudes - self.altitudes[before]) / passed)

    @property
    def pieces(self) -> list[tuple[int, int]]:
        """First row and end of the pieces between gaps of more than a minute, of at least 20
        positions.
        """
        cuts = np.flatnonzero(np.diff(self.times) > LONGEST_STEP) + 1
        borders = [0, *cuts.tolist(), len(self.times)]
        return [(a, b) for a, b in pairwise(borders) if b - a >= 20]


def clean_flight(identity: str, tier: Tier, reports: pd.DataFrame) -> Flight:
    """Return a flight of reports in any order, without repeated and interpolated positions: their
    time [s], latitude, longitude and track, an angle clockwise from north [deg], NaN where not
    reported.
    """
    axes = ["latitude", "longitude"]
    known = reports.dropna(subset=["time", *axes]).sort_values("time", kind="stable")
    moved = known[(known[axes].diff() != 0.0).any(axis=1)].drop_duplicates("time")
    times, places = moved["time"], moved[axes]
    share = times.diff() / (times.shift(-1) - times.shift())
    line = places.shift().mul(1.0 - share, axis=0) + places.shift(-1).mul(share, axis=0)
    # A position so close to the line between its neighbours [deg] was interpolated.
    rows = moved[~((places - line).abs().max(axis=1) < 2e-8)]
    if len(rows) < 50:
        raise ArgumentError(f"flight {identity} has {len(rows)} positions: expected at least 50")
    passed = rows["time"].to_numpy()
    return Flight(
        identity,
        tier,
        passed - passed[0],
        on_plane(*rows[axes].to_numpy().T),
        np.radians(90.0 - rows["track"].to_numpy()),
    )


def on_plane(latitudes: FloatArray, longitudes: FloatArray) -> FloatArray:
    """Return x east and y north [m], (n, 2), of latitudes and longitudes (n,) [deg]: the azimuthal
    equidistant projection about their middle.
    """
    latitude, longitude = (
        round(
            float(values.min() + values.max()) / 2.0,
            6,
        )
        for values in (latitudes, np.unwrap(longitudes, period=360.0))
    )
    plane = Proj(
        proj="aeqd",
        lat_0=latitude,
        lon_0=longitude,
        ellps="WGS84",
    )
    return np.transpose(plane(longitudes, latitudes))


def stack_flights(flights: Sequence[Flight], longest: int = 2**31, margin: int = 0) -> Batch:
    """Return the pieces of flights as one batch, cut into parts of at most `longest` positions;
    `margin` positions before and after a part are filtered too, so that it is as without the cut.
    """
    pieces = []
    counted = []
    for k, flight in enumerate(flights):
        for first, end in flight.pieces:
            for begin in range(first, end, longest):
                stop = min(begin + longest, end)
                pieces.append((k, max(begin - margin, first), min(stop + margin, end)))
                counted.append((begin, stop))
    steps = np.arange(max(end - first for _, first, end in pieces))
    climbs = [flight.climbs for flight in flights]
    columns = []
    for k, first, end in pieces:
        rows = np.minimum(first + steps, end - 1)
        inside = (first + steps < end)[:, None]
        positions = np.where(
            inside,
            flights[k].positions[rows],
            np.nan,
        )
        columns.append((flights[k].times[rows], positions, climbs[k][rows]))
    arrays = [np.stack(parts, axis=1) for parts in zip(*columns, strict=True)]
    errors = np.array([flights[k].tier[1:] for k, _, _ in pieces]).T
    lengths = tuple(len(flight.times) for flight in flights)
    return Batch(
        tuple(pieces),
        tuple(counted),
        lengths,
        *arrays,
        *errors,
    )


def tier_of(identity: str, received: bool, times: FloatArray) -> Tier:
    """Return the tier of a flight with reports at times (n,) [s]; `received`: they are those of
    reception.
    """
    if identity in SCORED["stress"].split():
        return TIERS["stress"]
    step = float(np.median(np.diff(times))) if len(times) > 1 else np.inf
    resampled = f" {identity.partition(':')[0]}:" in f" {SCORED['D']}"
    name = "D" if resampled or step > 6.0 else "C" if step > 2.5 else "A" if received else "B"
    return TIERS[name]
