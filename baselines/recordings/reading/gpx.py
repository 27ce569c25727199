"""GPX files: the tracks of GPS watches and loggers."""

import gpxpy
import pandas as pd

from baselines.recordings.reading.table import Table
from hybrid_env.checks import ArgumentError, reject


def read_gpx(content: bytes, name: str) -> Table:
    """Read the track points of a GPX file: time, lat, lon, and the track and the segment of each point.

    Raises:
        ArgumentError: it is not GPX, or has no track points.
    """
    try:
        tracks = gpxpy.parse(content.decode("utf-8-sig", errors="strict")).tracks
    except (gpxpy.gpx.GPXException, ValueError, TypeError, LookupError, RecursionError) as error:
        reason = " ".join(str(error).split())[:100]
        raise ArgumentError(f"{name}: the file begins as XML but is not GPX ({reason})") from None
    rows = [
        (point.time, point.latitude, point.longitude, track.name or f"track {number}", (number, part))
        for number, track in enumerate(tracks, start=1)
        for part, segment in enumerate(track.segments)
        for point in segment.points
    ]
    if not rows:
        raise reject("file", name, "a GPX file with track points (trkpt)")
    times, latitudes, longitudes, objects, segments = zip(*rows, strict=True)
    columns = {"lat": latitudes, "lon": longitudes, "track_id": objects}
    frame = pd.DataFrame(columns)
    if any(time is not None for time in times):
        frame.insert(0, "time", pd.to_datetime(pd.Series(times, dtype=object), utc=True))
    names = tuple(frame.columns)
    frame.columns = range(len(names))
    return Table(name, frame, names, row_word="point", segments=pd.factorize(pd.Series(segments))[0])
