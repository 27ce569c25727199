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
    tracks: FloatArray | float = np.nan
    # (n,) [m]
    altitudes: FloatArray | float = 0.0

    @property
    def climbs(self) -> FloatArray:
        """(n,) climb rate in the last 5 s, or since the position before if that is longer ago
        [m/s].
        """
        last = np.maximum(np.arange(len(self.times)) - 1, 0)
        before = np.minimum(np.searchsorted(self.times, self.times - 5.0), last)
        altitudes = np.broadcast_to(self.altitudes, len(last))
        passed = np.maximum(self.times - self.times[before], 1.0)
        return (altitudes - altitudes[before]) / passed

    @property
    def pieces(self) -> list[slice]:
        """Rows of the pieces between gaps of more than a minute, of at least 20 positions."""
        gaps = np.flatnonzero(np.diff(self.times) > LONGEST_STEP) + 1
        borders = [0, *gaps.tolist(), len(self.times)]
        return [slice(a, b) for a, b in pairwise(borders) if b - a >= 20]


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
        round(float(values.min() + values.max()) / 2.0, 6)
        for values in (latitudes, np.unwrap(longitudes, period=360.0))
    )
    plane = Proj(proj="aeqd", lat_0=latitude, lon_0=longitude, ellps="WGS84")
    return np.transpose(plane(longitudes, latitudes))


def stack_flights(flights: Sequence[Flight], longest: int = 2**31, margin: int = 0) -> Batch:
    """Return the pieces of flights as one batch, cut into parts of at most `longest` positions;
    `margin` positions before and after a part are filtered too, so that it is as without the cut.
    """
    offsets = np.cumsum([0, *(len(flight.times) for flight in flights)])
    parts = [
        (*np.array([piece.start, piece.stop, begin]) + offset, *flight.tier[1:])
        for flight, offset in zip(flights, offsets[:-1], strict=True)
        for piece in flight.pieces
        for begin in range(piece.start, piece.stop, longest)
    ]
    low, high, begin, across, timing = np.array(parts).T
    stop = np.minimum(begin + longest, high)
    first, end = np.maximum(begin - margin, low), np.minimum(stop + margin, high)
    steps = first + np.arange((end - first).max())[:, None]
    rows = np.minimum(steps, end - 1.0).astype(np.int64)
    columns = zip(*((each.times, each.positions, each.climbs) for each in flights), strict=True)
    times, positions, climbs = (np.concatenate(values)[rows] for values in columns)
    present = steps < end
    positions[~present] = np.nan
    counted = (steps >= begin) & (steps < stop)
    return Batch(offsets, rows, present, counted, times, positions, climbs, across, timing)


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
