"""The recorded flights in the samples of the package `traffic`, read without importing it, where
the user has them. ADS-B reports, most of them from the OpenSky Network. Olive 2019, "traffic, a
toolbox for processing and analysing air traffic data", doi 10.21105/joss.01518.
"""

import gzip
import importlib.util
import io
from pathlib import Path

import numpy as np
import pandas as pd

from hybrid_env import ArgumentError
from studies.flights.flight import UNUSABLE, Flight, clean_flight, tier_of
from studies.flights.turns import FloatArray

# Reports of an aircraft that are further apart in time [s] belong to different flights.
GAP = 600.0
SUFFIX = ".json.gz"
# Larger times since 1970 are in milliseconds.
MILLISECONDS = 1e11
INSTALL = "expected the package 'traffic' (pip install --no-deps traffic), or the folder of it"


class Samples:
    """The sample files of a source: a folder with `.json.gz` files, also in its subfolders. None
    uses the installed package. Raises `ArgumentError` if there are no samples.
    """

    def __init__(self, source: Path | str | None = None):
        self.source = installed_samples() if source is None else Path(source)
        places = sorted(self.source.rglob(f"*{SUFFIX}"))
        self._files = {place.name.removesuffix(SUFFIX): place for place in places}
        if not self._files:
            raise ArgumentError(f"source={self.source} contains no {SUFFIX} files: {INSTALL}")
        self._last: tuple[str, dict[str, pd.DataFrame]] = "", {}

    def flights_of(self, name: str) -> dict[str, pd.DataFrame]:
        """Return the reports of every flight of a file by its id `file:icao24:k`, k from 0."""
        # Flights of a file are often read one by one.
        if self._last[0] == name:
            return self._last[1]
        if name not in self._files:
            raise ArgumentError(f"file={name!r}: expected a sample of {self.source}")
        content = gzip.decompress(self._files[name].read_bytes())
        table = pd.read_json(io.BytesIO(content), dtype=False)
        flights = {}
        for aircraft, reports in table.groupby("icao24", sort=True):
            times = report_times(reports["timestamp"])
            order = np.argsort(times, kind="stable")
            cuts = np.flatnonzero(np.diff(times[order]) > GAP) + 1
            for k, rows in enumerate(np.split(order, cuts)):
                flights[f"{name}:{aircraft}:{k}"] = reports.iloc[rows]
        self._last = name, flights
        return flights

    def flight(self, identity: str) -> Flight:
        """Return a flight by its id `file:icao24:k`, if it has enough positions."""
        name, separator, _ = identity.partition(":")
        if name in UNUSABLE:
            raise ArgumentError(f"flight={identity!r}: turns cannot be seen in this file")
        flights = self.flights_of(name) if separator else {}
        if identity not in flights:
            some = f", such as {', '.join(list(flights)[:5])}" if flights else ""
            raise ArgumentError(f"flight={identity!r}: expected an id file:icao24:k{some}")
        reports = flights[identity]
        times = report_times(reports["timestamp"])
        # When the position was received; the timestamp is that of the report.
        if "last_position" in reports:
            received = report_times(reports["last_position"])
            times = np.where(np.isnan(received), times, received)
        tier = tier_of(identity, "last_position" in reports, times)
        values = (_numbers(reports[column]) for column in ("latitude", "longitude", "track"))
        return clean_flight(identity, tier, times, *values)


def installed_samples() -> Path:
    """Return the folder of the samples of the installed package, which is not imported."""
    spec = importlib.util.find_spec("traffic")
    for place in (spec and spec.submodule_search_locations) or ():
        folder = Path(place) / "data" / "samples"
        if folder.is_dir():
            return folder
    raise ArgumentError(f"source=None is not allowed: {INSTALL}")


def report_times(column: pd.Series) -> FloatArray:
    """Return times since 1970 [s], NaN where there is none, of dates or of numbers [s or ms]."""
    if column.dtype.kind == "M":
        milliseconds = column.astype("datetime64[ms]").to_numpy()
        return np.where(np.isnat(milliseconds), np.nan, milliseconds.astype(np.int64) / 1000.0)
    values = _numbers(column)
    return np.where(values > MILLISECONDS, values / 1000.0, values)


def _numbers(column: pd.Series) -> FloatArray:
    return np.asarray(pd.to_numeric(column, errors="coerce"), np.float64)
