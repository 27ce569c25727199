"""Rows of files in which positions are nested: XML, JSON, and sentences of NMEA and AIS."""

import functools
import json
import operator
import re
from collections.abc import Iterable
from contextlib import suppress
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pandas as pd

from baselines.recordings.reading.names import role_of
from hybrid_env.checks import ArgumentError

# Elements of XML that are positions, of GPX, TCX and the floating car data of SUMO.
POINTS = "trkpt", "Trackpoint", "vehicle", "person"
# Roles of what stands inside of them.
LEAVES = "time", "lat", "lon", "z", "speed", "course", "valid", "dilution"


def rows_of_xml(text: str) -> pd.DataFrame:
    """Return the positions of GPX, TCX, KML with gx:Track, or SUMO, with their `segment`."""
    try:
        # It is text now, whatever its first line says of the bytes.
        root = ElementTree.fromstring(re.sub(r"^\s*<\?xml[^>]*>", "", text))
    except (ElementTree.ParseError, ValueError, RecursionError) as error:
        raise ArgumentError(f"begins as XML but is damaged ({error})") from None
    rows: list[dict[str, Any]] = []
    # What is known of all points that follow.
    outer: dict[str, Any] = {"segment": 0}
    tracks = 0
    for element in root.iter():
        kind = _plain(element)
        if kind in ("trk", "Placemark"):
            tracks += 1
            name = element.findtext("{*}name") or ""
            outer["track_id"] = name.strip() or f"track {tracks}"
        elif kind == "timestep":
            outer["time"] = element.get("time")
        elif kind in ("trkseg", "Track"):
            outer["segment"] += 1
            # In a gx:Track of KML times and places stand side by side.
            times = [time.text for time in element.iterfind("{*}when")]
            places = [(place.text or "").split() for place in element.iterfind("{*}coord")]
            rows += [outer | row for row in _timed_places(times, places)]
        elif kind in POINTS:
            leaves = {_plain(leaf): leaf.text for leaf in element.iter() if not len(leaf)}
            # Other leaves, such as a heart rate, are no columns.
            known = {name: cell for name, cell in leaves.items() if role_of(name) in LEAVES}
            rows.append(outer | element.attrib | known)
    if not rows:
        raise ArgumentError(
            "XML without points of a track of GPX, TCX, KML (gx:Track) or SUMO: convert it"
            " to GPX, for example by gpsbabel or by ogr2ogr -f GPX"
        )
    return pd.DataFrame(rows)


def _plain(element: ElementTree.Element) -> str:
    """Return the name of an element without its namespace."""
    return element.tag.rpartition("}")[2]


def _timed_places(times: Iterable[Any], places: Iterable[Any]) -> list[dict[str, Any]]:
    """Return rows of times and of places, each a longitude, a latitude and perhaps an altitude."""
    return [
        {"time": time} | dict(zip(("lon", "lat", "altitude"), place, strict=False))
        for time, place in zip(times, places, strict=False)
    ]


def rows_of_json(text: str) -> pd.DataFrame:
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
            "neither GeoJSON with times nor rows of JSON: convert it to CSV, for example"
            " by ogr2ogr -f CSV -lco GEOMETRY=AS_XY"
        )
    return frame.rename(columns=str)


def _rows(feature: dict[str, Any], name: str) -> list[dict[str, Any]]:
    """Return the rows of a feature of GeoJSON, or of an object without a geometry itself."""
    geometry = feature.get("geometry")
    if geometry is None:
        return [feature]
    properties, places = feature["properties"], geometry["coordinates"]
    if geometry["type"] == "Point":
        [row] = _timed_places([properties.get("time")], [places])
        return [row | properties]
    times = properties.get("coordTimes") or properties["coordinateProperties"]["times"]
    outer = {"track_id": properties.get("name", name)}
    return [outer | row for row in _timed_places(times, places)]


def rows_of_nmea(lines: "pd.Series[str]") -> tuple[pd.DataFrame, pd.Index]:
    """Return the positions of the RMC sentences of a log of NMEA, or of the GGA ones if it has no
    others, and the lines of sentences with a wrong checksum.
    """
    names = {
        "RMC": ["time", "status", "lat", "lat_dir", "lon", "lon_dir", "speed", "course", "date"],
        "GGA": ["time", "lat", "lat_dir", "lon", "lon_dir", "fix_quality"],
    }
    kind = "RMC" if lines.str.contains(r"\$..RMC,").any() else "GGA"
    form = rf"\$(?P<text>..{kind},(?P<cells>[^*]*))(?:\*(?P<sum>[0-9A-Fa-f]{{2}}))?"
    found = lines.str.extract(form).dropna(subset="text")
    sums = found.text.map(lambda text: f"{functools.reduce(operator.xor, text.encode()):02X}")
    right = found["sum"].isna() | (sums == found["sum"].str.upper())
    cells = found.cells[right].str.split(",", expand=True).reindex(columns=range(len(names[kind])))
    cells = cells.set_axis(names[kind], axis=1).astype(object).fillna("").astype(str)
    if kind == "RMC":
        # Day, month, year.
        dates = cells.pop("date").str.replace(r"(..)(..)(..)", r"20\3-\2-\1T", regex=True)
        cells["time"] = dates + cells["time"].str.replace(r"^(..)(..)", r"\1:\2:", regex=True)
    return cells.where(cells != ""), found.index[~right]


def rows_of_ais(lines: "pd.Series[str]") -> tuple[pd.DataFrame, pd.Index]:
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
        raise ArgumentError("AIS sentences without times of reception: record these too")
    reports: dict[int, dict[str, Any]] = {}
    for line, text in found[2].items():
        with suppress(pyais.exceptions.AISBaseException):
            reports[line] = pyais.decode(text, error_if_checksum_invalid=True).asdict()
    rows = pd.DataFrame.from_dict(reports, "index")
    rows = rows.reindex(columns=["mmsi", "lat", "lon", "speed", "course"]).assign(time=times)
    # Other messages have no place; larger numbers say that nothing is known.
    limits = {"lat": 90.0, "speed": 102.1, "course": 359.9}
    for name, limit in limits.items():
        numbers = pd.to_numeric(rows[name], errors="coerce")
        rows[name] = numbers.where(numbers.abs() <= limit)
    rows = rows.dropna(subset=["lat", "lon"])
    if rows.empty:
        raise ArgumentError("AIS sentences without reports of positions")
    return rows, found.index.difference([*reports])


# Sentences of which a log may consist, and what reads them.
SENTENCES = {r"\$..(?:RMC|GGA),": rows_of_nmea, r"!..VD[MO],": rows_of_ais}
