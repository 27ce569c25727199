"""The recorded flights in the samples of the package `traffic`, read without importing it, where
the user has them. ADS-B reports, most of them from the OpenSky Network. Olive 2019, "traffic, a
toolbox for processing and analysing air traffic data", doi 10.21105/joss.01518.
"""

import gzip
import importlib.util
import io
import zipfile
import zlib
from pathlib import Path

import numpy as np
import pandas as pd

from baselines.recordings.flights.flight import UNUSABLE, Flight, clean_flight, tier_of
from hybrid_env.checks import ArgumentError, FloatArray, reject

# Reports of an aircraft that are further apart in time [s] belong to different flights.
GAP = 600.0
SUFFIX = ".json.gz"
# Larger times since 1970 are in milliseconds.
MILLISECONDS = 1e11
INSTALL = (
    "expected the package 'traffic' (pip install --no-deps traffic), or the folder or wheel of it"
)


class Samples:
    """The sample files of a source: a folder with `.json.gz` files, also in its subfolders, or a
    wheel of the package. None uses the installed package. Raises `ArgumentError` if there are no
    samples.
    """

    def __init__(self, source: Path | str | None = None):
        self.source = installed_samples() if source is None else Path(source)
        places: list[Path | zipfile.Path]
        if self.source.is_dir():
            places = [*sorted(self.source.rglob(f"*{SUFFIX}"))]
        elif zipfile.is_zipfile(self.source):
            archive = zipfile.ZipFile(self.source)
            places = [
                zipfile.Path(archive, name)
                for name in sorted(archive.namelist())
                if name.endswith(SUFFIX)
            ]
        else:
            raise ArgumentError(f"source={self.source} is not a folder or a wheel: {INSTALL}")
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
            raise reject("file", name, f"a sample of {self.source}")
        place = self._files[name]
        try:
            table = pd.read_json(io.BytesIO(gzip.decompress(place.read_bytes())), dtype=False)
        except (OSError, EOFError, ValueError, zipfile.BadZipFile, zlib.error) as error:
            raise ArgumentError(f"{place} cannot be read: {error}") from None
        missing = {"timestamp", "icao24", "latitude", "longitude", "track"} - set(table.columns)
        if missing:
            raise ArgumentError(f"{place} has no column {', '.join(sorted(missing))}")
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
            raise reject(
                "flight",
                identity,
                "a file in which turns can be seen; this one is too sparse",
            )
        flights = self.flights_of(name) if separator else {}
        if identity not in flights:
            some = f", such as {', '.join(list(flights)[:5])}" if flights else ""
            raise reject("flight", identity, f"an id file:icao24:k{some}")
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
