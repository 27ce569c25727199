"""Rows of files in which positions are nested: XML, JSON, and sentences of NMEA and AIS."""

import functools
import json
import operator
import re
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pandas as pd

from baselines.recordings.reading.names import role_of
from hybrid_env.checks import ArgumentError

# Elements of XML that are positions, of GPX, TCX and the floating car data of SUMO.
POINTS = "trkpt", "Trackpoint", "vehicle", "person"


def rows_of_xml(text: str, file: str) -> pd.DataFrame:
    """Return the positions of GPX, TCX, KML with gx:Track, or SUMO, with their `segment`."""
    try:
        # It is text now, whatever its first line says of the bytes.
        root = ElementTree.fromstring(re.sub(r"^\s*<\?xml[^>]*>", "", text))
    except (ElementTree.ParseError, ValueError, RecursionError) as error:
        raise ArgumentError(f"{file}: begins as XML but is damaged ({error})") from None
    rows: list[dict[str, Any]] = []
    # What is known of all points that follow.
    outer: dict[str, Any] = {"segment": 0}
    tracks = 0
    # Roles of what stands inside of them.
    wanted = "time", "lat", "lon", "z", "speed", "course", "valid", "dilution"
    for element in root.iter():
        kind = _plain(element.tag)
        if kind in ("trk", "Placemark"):
            tracks += 1
            name = element.findtext("{*}name")
            outer["track_id"] = (name or "").strip() or f"track {tracks}"
        elif kind == "timestep":
            outer["time"] = element.get("time")
        elif kind in ("trkseg", "Track"):
            outer["segment"] += 1
            rows += [outer | point for point in _placed(element)]
        elif kind in POINTS:
            leaves = {_plain(leaf.tag): leaf.text for leaf in element.iter() if not len(leaf)}
            # Other leaves, such as a heart rate, are no columns.
            known = {name: cell for name, cell in leaves.items() if role_of(name) in wanted}
            rows.append(outer | element.attrib | known)
    convert = "convert it to GPX, for example by gpsbabel or by ogr2ogr -f GPX"
    if not rows:
        kinds = "points of a track of GPX, TCX, KML (gx:Track) or SUMO"
        raise ArgumentError(f"{file}: XML without {kinds}: {convert}")
    return pd.DataFrame(rows)


def _plain(tag: str) -> str:
    """Return the name of an element without its namespace."""
    return tag.rpartition("}")[2]


def _placed(track: ElementTree.Element) -> list[dict[str, str | None]]:
    """Return the points of a gx:Track of KML, whose times and places stand side by side."""
    times = [time.text for time in track.iterfind("{*}when")]
    places = [(place.text or "").split() for place in track.iterfind("{*}coord")]
    return [
        {"time": time} | dict(zip(("lon", "lat", "altitude"), place, strict=False))
        for time, place in zip(times, places, strict=False)
        if len(place) > 1
    ]


def rows_of_json(text: str, file: str) -> pd.DataFrame:
    """Return the positions of GeoJSON, of a list of objects, or of lines of objects."""
    try:
        try:
            data = json.loads(text)
        except json.JSONDecodeError:
            data = [json.loads(line) for line in text.splitlines() if line.strip()]
        if isinstance(data, dict):
            # Such as the features of GeoJSON.
            lists = [rows for rows in data.values() if isinstance(rows, list)]
            data = next((rows for rows in lists if rows and isinstance(rows[0], dict)), [data])
        rows = [row for k, feature in enumerate(data, 1) for row in _rows(feature, f"line {k}")]
        frame = pd.json_normalize(rows)
    except (ValueError, TypeError, LookupError, AttributeError, RecursionError):
        frame = pd.DataFrame()
    frame = frame.map(lambda cell: cell if isinstance(cell, (str, int, float)) else None)
    frame = frame.dropna(axis=1, how="all")
    if frame.empty:
        raise ArgumentError(
            f"{file}: neither GeoJSON with times nor rows of JSON: convert it to CSV, for example"
            " by ogr2ogr -f CSV -lco GEOMETRY=AS_XY"
        )
    frame.columns = frame.columns.astype(str)
    return frame


def _rows(feature: dict[str, Any], name: str) -> list[dict[str, Any]]:
    """Return the rows of a feature of GeoJSON, or of an object without a geometry itself."""
    geometry = feature.get("geometry")
    if geometry is None:
        return [feature]
    properties, places = feature["properties"], geometry["coordinates"]
    if geometry["type"] == "Point":
        return [properties | dict(zip(("lon", "lat", "altitude"), places, strict=False))]
    times = properties.get("coordTimes") or properties["coordinateProperties"]["times"]
    return [
        {"time": time, "track_id": properties.get("name", name)}
        | dict(zip(("lon", "lat", "altitude"), place, strict=False))
        for place, time in zip(places, times, strict=True)
    ]


def rows_of_nmea(lines: "pd.Series[str]") -> tuple[pd.DataFrame, pd.Index]:
    """Return the positions of the RMC sentences of a log of NMEA, or of the GGA ones if it has no
    others, and the lines of sentences with a wrong checksum.
    """
    form = r"\$(..{},([^*]*))(?:\*([0-9A-Fa-f]{{2}}))?"
    found = lines.str.extract(form.format("RMC")).dropna(subset=0)
    names = ["time", "status", "lat", "lat_dir", "lon", "lon_dir", "speed", "course", "date"]
    dated = len(found) > 0
    if not dated:
        found = lines.str.extract(form.format("GGA")).dropna(subset=0)
        names = ["time", "lat", "lat_dir", "lon", "lon_dir", "fix_quality"]
    sums = found[0].map(lambda text: functools.reduce(operator.xor, text.encode()))
    right = found[2].isna() | (sums == found[2].fillna("0").map(lambda text: int(text, 16)))
    cells = found[1][right].str.split(",", expand=True).reindex(columns=range(len(names)))
    cells = cells.set_axis(names, axis=1).astype(object).fillna("").astype(str)
    if dated:
        # Day, month, year.
        dates = cells.pop("date").str.replace(r"(..)(..)(..)", r"20\3-\2-\1T", regex=True)
        cells["time"] = dates + cells["time"].str.replace(r"^(..)(..)", r"\1:\2:", regex=True)
    return cells.where(cells != ""), found.index[~right]


def rows_of_ais(lines: "pd.Series[str]", file: str) -> tuple[pd.DataFrame, pd.Index]:
    """Return the reports of positions in a log of AIS, and the lines of those that are damaged.

    A line has a sentence and the time of its reception, in a tag block, before or after it.
    """
    # Other commands start faster.
    import pyais

    before = r"^(?:\\.*?\bc:([\d.]+).*?\\|(.*?)[\s,;]*)"
    # All reports of positions fit in one sentence.
    sentence = r"(!..VD[MO],1,1,[^*]*\*[0-9A-Fa-f]{2})"
    found = lines.str.extract(before + sentence + r"[\s,;]*(.*)$").dropna(subset=2)
    times = found[[0, 1, 3]].replace("", np.nan).bfill(axis=1)[0]
    if times.isna().mean() > 0.5:
        raise ArgumentError(f"{file}: AIS sentences without times of reception: record these too")
    rows, damaged = [], []
    for line, time, text in zip(found.index, times, found[2], strict=True):
        try:
            report: dict[str, Any] = pyais.decode(text, error_if_checksum_invalid=True).asdict()
        except pyais.exceptions.AISBaseException:
            damaged.append(line)
            continue
        # Other messages have none; these numbers say that nothing is known.
        names = "lat", "lon", "speed", "course"
        lat, lon, speed, course = (report.get(name) for name in names)
        if isinstance(lat, float) and isinstance(lon, float) and abs(lat) <= 90.0:
            row = {"time": time, "mmsi": report["mmsi"], "lat": lat, "lon": lon}
            row["sog"] = speed if speed is not None and speed < 102.2 else None
            row["cog"] = course if course is not None and course < 360.0 else None
            rows.append((line, row))
    if not rows:
        raise ArgumentError(f"{file}: AIS sentences without reports of positions")
    numbers, cells = zip(*rows, strict=True)
    return pd.DataFrame(cells, numbers).astype(object), pd.Index(damaged)
