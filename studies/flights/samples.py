"""The recorded flights in the samples of the package `traffic`, read without importing it, where
the user has them. ADS-B reports, most of them from the OpenSky Network. Olive 2019, "traffic, a
toolbox for processing and analysing air traffic data", doi 10.21105/joss.01518.
"""

import functools
import importlib.util
from pathlib import Path

import numpy as np
import pandas as pd

from hybrid_env import ArgumentError
from studies.flights.flight import Flight, clean_flight, tier_of
from studies.flights.turns import FloatArray

INSTALL = "expected the package 'traffic' (pip install --no-deps traffic), or the folder of it"


def sample_flight(source: Path | None, identity: str) -> Flight:
    """Return a flight by its id `file:icao24:k`, if it has enough positions, from a folder with
    `.json.gz` files, also in its subfolders; None is the installed package.

    Raises:
        ArgumentError: there are no samples, or not this flight.
    """
    folder = installed_samples() if source is None else source
    file = next(folder.rglob(f"{identity.partition(':')[0]}.json.gz"), None)
    reports = None if file is None else flights_of(file).get(identity)
    if reports is None:
        raise ArgumentError(
            f"flight={identity!r}: expected file:icao24:k of a file .json.gz in {folder}; {INSTALL}"
        )
    times = reports["time"].to_numpy()
    # When the position was received; the timestamp is that of the report.
    received = "last_position" in reports
    if received:
        positioned = report_times(reports["last_position"])
        times = np.where(np.isnan(positioned), times, positioned)
    columns = reports[["latitude", "longitude", "track"]]
    values = columns.apply(pd.to_numeric, errors="coerce").astype(np.float64)
    return clean_flight(identity, tier_of(identity, received, times), values.assign(time=times))


# Flights of a file are often read one by one.
@functools.lru_cache(maxsize=1)
def flights_of(place: Path, gap: float = 600.0) -> dict[str, pd.DataFrame]:
    """Return the reports of every flight of a file by its id `file:icao24:k`, k from 0. Reports of
    an aircraft that are further apart in time than the gap [s] belong to different flights.
    """
    table = pd.read_json(place, dtype=False)
    table = table.assign(time=report_times(table["timestamp"])).sort_values("time", kind="stable")
    flights = {}
    for aircraft, reports in table.groupby("icao24", sort=True):
        for k, rows in reports.groupby((reports["time"].diff() > gap).cumsum()):
            flights[f"{place.name.removesuffix('.json.gz')}:{aircraft}:{k}"] = rows
    return flights


def installed_samples() -> Path:
    """Return the folder of the samples of the installed package, which is not imported."""
    spec = importlib.util.find_spec("traffic")
    if spec is None or spec.origin is None:
        raise ArgumentError(f"source=None is not allowed: {INSTALL}")
    return Path(spec.origin).parent / "data" / "samples"


def report_times(column: pd.Series) -> FloatArray:
    """Return times since 1970 [s], NaN where there is none, of dates or of numbers [s or ms]."""
    if column.dtype.kind == "M":
        milliseconds = column.dt.floor("ms") - pd.Timestamp(0, tz=column.dt.tz)
        return (milliseconds / pd.Timedelta(1, "s")).to_numpy()
    values = pd.to_numeric(column, errors="coerce").to_numpy(np.float64)
    # Larger times are in milliseconds.
    return np.where(values > 1e11, values / 1000.0, values)
