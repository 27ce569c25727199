"""One track as everyday loggers write it: what a person reads at once, and what needs an option."""

import functools
import json
import operator

import numpy as np
import pandas as pd
import pyais
import pyproj
import pytest
from recorded_tracks import directions

from baselines.recordings.projection import centred_projection
from hybrid_env.checks import ArgumentError

ROWS = 120
STEP = 2.5
T = STEP * np.arange(ROWS)
HEADING = np.cumsum(np.where(np.arange(ROWS) // 30 % 2 == 0, 0.0, 0.1))
X, Y = np.cumsum(30.0 * directions(HEADING), axis=0).T
LAT, LON = 47.25 + 9e-6 * Y, 9.3 + 13e-6 * X
DATES = pd.Timestamp("2026-05-13T11:58:00") + pd.to_timedelta(T, unit="s")
UNIX = DATES.to_numpy().astype("datetime64[ms]").astype(np.int64) / 1e3
EAST, NORTH = centred_projection(LAT, LON).forward(LAT, LON).T
PLACE = {"lat": LAT.round(7), "lon": LON.round(7)}
LINES = pd.DataFrame({"time": T, **PLACE}).to_csv(index=False).splitlines()
TEXT = "\n".join(LINES) + "\n"
LOST = (T > 100) & (T < 130)


def clock(**columns):
    """A file with columns of times."""
    return pd.DataFrame(columns | PLACE)


def dated(form, places=3):
    """Dates in a form of strftime, their fraction of a second cut to so many places."""
    texts = DATES.strftime(form)
    return [text[: len(text) - 6 + places] if form.endswith("%f") else text for text in texts]


def place(lat, lon, *names):
    """A file with other cells of latitude and longitude, or under other names."""
    return pd.DataFrame(dict(zip(("Zeit", *(names or PLACE)), (T, lat, lon), strict=True)))


def degrees(form):
    """A file with degrees, minutes and seconds."""
    texts = []
    for values, letter in ((LAT, "N"), (LON, "E")):
        minutes, seconds = np.divmod(3600.0 * values, 60.0)
        whole, minutes = np.divmod(minutes, 60.0)
        rows = zip(whole.astype(int), minutes.astype(int), seconds, strict=True)
        texts.append([form.format(d=d, m=m, s=f"{s:.4f}", c=letter) for d, m, s in rows])
    return place(*texts)


def text(*lines):
    return "\n".join([*lines, ""])


def gpx(encoding="UTF-8"):
    points = [
        f'<trkpt lat="{a:.7f}" lon="{b:.7f}"><time>{d.isoformat()}Z</time></trkpt>'
        for a, b, d in zip(LAT, LON, DATES, strict=True)
    ]
    head = f'<?xml version="1.0" encoding="{encoding}"?><gpx><trk><name>ö</name><trkseg>'
    return text(head, *points, "</trkseg></trk></gpx>").encode(encoding)


def lost(values):
    """A file in which the position is missing for a while."""
    frame = pd.DataFrame({"time": T, **PLACE}).astype(object)
    frame.loc[LOST, ["lat", "lon"]] = values
    return frame


def plane(*names, **more):
    """A file with x east and y north, or under other names."""
    return pd.DataFrame({"time": T, names[0]: EAST.round(3), names[1]: NORTH.round(3)} | more)


def players(*more, names=("a", "b", "c"), **columns):
    """A file of several objects side by side, in a column that is no known name."""
    parts = [plane("x", "y").assign(player=name) for name in names]
    for k, part in enumerate(parts):
        part["x"] += 40.0 * k
    return pd.concat(parts).assign(**columns).sort_values("time", kind="stable")


def ships(apart):
    """Two ships, of which the second one has the name of a third, which is rarely heard."""
    other = clock(time=T + 1.0)[::5].assign(lat=lambda rows: rows.lat + apart)
    named = [(clock(time=T), 7), (clock(time=T), 8), (other, 8)]
    return pd.concat([rows.assign(mmsi=name) for rows, name in named]).sort_values("time")


def sentences(*kinds, wrong=()):
    """A log of NMEA; the checksums of some rows are wrong."""
    lines = []
    for k, date in enumerate(DATES):
        clock, day = date.strftime("%H%M%S.%f")[:10], date.strftime("%d%m%y")
        lat, lon = (f"{int(v) * 100 + v % 1 * 60:012.6f}" for v in (LAT[k], LON[k]))
        forms = {
            "RMC": f"GPRMC,{clock},{'V' if LOST[k] else 'A'},{lat},N,{lon},E,9.0,0.0,{day},,,A",
            "GGA": f"GPGGA,{clock},{lat},N,{lon},E,{int(not LOST[k])},09,0.9,400.0,M,47.0,M,,",
        }
        for kind in kinds:
            total = functools.reduce(operator.xor, forms[kind].encode()) ^ (k in wrong)
            lines.append(f"${forms[kind]}*{total:02X}")
    return text(*lines)


def marked_up(form, head, foot):
    """A file of XML with an element for each row."""
    rows = zip(DATES.strftime("%Y-%m-%dT%H:%M:%S.%fZ"), LAT, LON, T, EAST, NORTH, strict=True)
    points = [form.format(d=d, a=a, b=b, t=t, x=x, y=y) for d, a, b, t, x, y in rows]
    return text(f'<?xml version="1.0" encoding="UTF-8"?>{head}', *points, foot)


KML = marked_up(
    "<when>{d}</when><gx:coord>{b:.7f} {a:.7f} 500</gx:coord>",
    '<kml xmlns="http://k/2.2" xmlns:gx="http://g/2.2"><Placemark><gx:Track>',
    "</gx:Track></Placemark></kml>",
)
TCX = marked_up(
    "<Trackpoint><Time>{d}</Time><Position><LatitudeDegrees>{a:.7f}</LatitudeDegrees>"
    "<LongitudeDegrees>{b:.7f}</LongitudeDegrees></Position><Value>90</Value></Trackpoint>",
    '<TrainingCenterDatabase xmlns="http://t/v2"><Lap><Track>',
    "</Track></Lap></TrainingCenterDatabase>",
)
SUMO = marked_up(
    '<timestep time="{t:.2f}"><vehicle id="a" x="{x:.3f}" y="{y:.3f}" speed="8.00" pos="5.1"/>'
    '<vehicle id="b" x="{x:.3f}" y="{y:.3f}" speed="8.00" pos="5.1"/></timestep>',
    "<fcd-export>",
    "</fcd-export>",
)
ISO = dated("%Y-%m-%dT%H:%M:%S.%fZ", 7)
COORDINATES = [[b, a, 500.0] for a, b in zip(LAT.round(7), LON.round(7), strict=True)]
LINE = {"type": "LineString", "coordinates": COORDINATES}


def feature(geometry, **properties):
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def geojson(*features):
    return json.dumps({"type": "FeatureCollection", "features": features})


POINTS = [
    feature({"type": "Point", "coordinates": place}, time=date)
    for place, date in zip(COORDINATES, ISO, strict=True)
]
CENTRE = pyproj.Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True)
ECEF = dict(zip("xyz", CENTRE.transform(LON, LAT, np.full(ROWS, 500.0)), strict=True))
ZONES = np.where(np.median(X) > X, 32, 33)
UTM = np.empty((ROWS, 2))
for zone in (32, 33):
    utm = pyproj.Proj(proj="utm", zone=zone)
    UTM[zone == ZONES] = np.column_stack(utm(LON, LAT))[zone == ZONES]
VELOCITY = {"vx": 0.0, "vy": 0.0}
FIT = "Type,Local Number,Message,Field 1,Value 1,Units 1"
AIS = "!AIVDM,1,1,,A,13HOI:0P0000VOHLCnHQKwvL05Ip,0*23"


def ais(form, wrong=()):
    """A log of AIS, of which some reports are damaged; with two messages that have no place."""
    lines = [
        AIS.replace("*23", "*24"),
        "!AIVDM,2,1,3,B,55P5TL01VIaAL@7WKO@mBplU@<PDhh000000001S,0*3E",
    ]
    for k, place in enumerate(zip(LAT, LON, strict=True)):
        report = {"type": 1, "mmsi": 244000001, "speed": 8.0, "course": 360.0}
        [sentence] = pyais.encode_dict(
            report | dict(zip(("lat", "lon"), place, strict=True)), sentence_type="VDM"
        )
        damaged = sentence[:-1] + "0123456789ABCDEF"[int(sentence[-1], 16) ^ (k in wrong)]
        lines.append(form.format(sentence=damaged, seconds=UNIX[k], date=ISO[k]))
    return text(*lines)


NO_FIX = "rows of a sensor without a fix (11)"
ASSUMED = "x east, y north is assumed: left is counter-clockwise"
NED = "x is north and y is east (NED)"
# Of what is refused.
NOT = "refused: "

SAID = "times are "
NO_TIME = "rows without a time"
CASES = {
    # Content; what the summary or a warning says, or why it is refused; options.
    "comma before milliseconds": (clock(time=dated("%Y-%m-%d %H:%M:%S,%f")), SAID + "dates from"),
    "UTC": (clock(time=dated("%Y-%m-%d %H:%M:%S.%f UTC", 10)), SAID + "dates from"),
    "12 hours": (
        clock(time=dated("%m/%d/%Y %I:%M:%S.%f %p", 9)),
        SAID + "dates (%m/%d/%Y %I:%M:%S.%f %p) from 2026-05-13",
    ),
    "month": (clock(time=dated("%d-%b-%Y %H:%M:%S.%f")), SAID + "dates (%d-%b-%Y %H:%M:%S.%f)"),
    "two digits": (clock(time=dated("%d/%m/%y %H:%M:%S.%f")), SAID + "dates (%d/%m/%y %H:%M"),
    "numbers": (clock(utc=dated("%H%M%S.%f")), SAID + "times of day (%H%M%S.%f)"),
    "some with a fraction": (
        clock(time=[str(date.time()) for date in DATES]),
        SAID + "times of day (%H:%M:%S.%f)",
    ),
    "beside a date": (
        clock(Datum=dated("%d.%m.%Y"), Uhrzeit=dated("%H:%M:%S.%f")),
        SAID + "dates and times of day (%d.%m.%Y %H:%M:%S.%f) from 2026-05-13T11:58:00Z",
    ),
    "numbers beside a date": (
        clock(DATE=dated("%d%m%y"), TIME=dated("%H%M%S.%f")),
        SAID + "dates and times of day (%d%m%y %H%M%S.%f) from 2026-05-13T11:58:00Z",
    ),
    "milliseconds": (clock(**{"time [ms]": 1e3 * T + 7e3}), SAID + "in ms"),
    "milliseconds that are said": (clock(time=1e3 * T), SAID + "in ms", {"time_unit": "ms"}),
    "nanoseconds": (clock(t_ns=(1e9 * UNIX).astype(np.int64)), "nanoseconds since 1970"),
    "zone": (clock(t=dated("%Y-%m-%dT%H:%M:%S.%f+02:00", 9)), "from 2026-05-13T09:58:00Z"),
    "basic": (clock(t=dated("%Y%m%dT%H%M%S.%fZ", 7)), "from 2026-05-13T11:58:00Z"),
    "day first": (clock(t=dated("%d.%m.%Y %H:%M:%S.%f")), "from 2026-05-13T11:58:00Z"),
    "microseconds": (clock(timestamp=(1e6 * T).astype(int) + 51_234_567), SAID + "in us"),
    "two clocks": (
        clock(timestamp=UNIX.astype(int) // 5, time_utc_usec=(1e6 * UNIX).astype(np.int64)),
        "'time_utc_usec' (column 2) taken as time, not 'timestamp' (column 1) (--columns)",
    ),
    "clock that is set late": (
        clock(time=np.where(T < 20, "1970-01-01T00:00:00.000", dated("%Y-%m-%dT%H:%M:%S.%f"))),
        "rows without a time (8)",
    ),
    "one ahead": (clock(timestamp=UNIX + 3600.0 * (T == 50.0)), "after those that follow (1)"),
    "E7": (
        place(*(1e7 * np.array([LAT, LON])).round().astype(int), "latitudeE7", "longitudeE7"),
        "latitude and longitude are whole numbers of 1e-7 degrees",
    ),
    "semicircles": (
        place(
            *(np.array([LAT, LON]) * 2**31 / 180.0).round().astype(int),
            "position_lat",
            "position_long",
        ),
        "latitude and longitude are semicircles",
    ),
    "radians": (place(*np.radians([LAT, LON]), "lat_rad", "lon_rad"), "longitude are radians"),
    "primes": (degrees("{d}° {m}\u2032 {s}\u2033 {c}"), ""),
    "spaces": (degrees("{c}{d} {m} {s}"), ""),
    "colons": (degrees("{d}:{m}:{s}{c}"), ""),
    "decimal commas": (place(*([f"{v:.9f}".replace(".", ",") for v in p] for p in (LAT, LON))), ""),
    "letters in columns": (place(LAT, LON).assign(**{"N/S": "N", "E/W": "E"}), ""),
    "letters": (place([f"{v:.9f}N" for v in LAT], [f"{v:.9f} E" for v in LON]), ""),
    "German": (place(LAT, LON, "Breite", "Länge"), ""),
    "Spanish": (place(LAT, LON, "Latitud", "Longitud"), ""),
    "Russian": (place(LAT, LON, "Широта", "Долгота"), ""),
    "Chinese": (place(LAT, LON, "纬度", "经度"), ""),
    "camel": (place(LAT, LON, "gpsLat", "gpsLon"), ""),
    "start": (
        place(LAT, LON, "OSD.latitude", "OSD.longitude").assign(
            **{"HOME.latitude": 47.0, "HOME.longitude": 9.0}
        ),
        "'OSD.latitude' (column 2) taken as lat, not 'HOME.latitude' (column 4) (--columns)",
    ),
    "two receivers": (
        place(LAT, LON, "GPS(0):Lat", "GPS(0):Long").assign(
            **{"GPS(1):Lat": LAT + 1.0, "GPS(1):Long": LON}
        ),
        "'GPS(0):Lat' (column 2) taken as lat, not 'GPS(1):Lat' (column 4) (--columns)",
    ),
    "AIS without a position": (lost([91.0, 181.0]), "rows whose position cannot be read (11)"),
    "zeros": (lost(0.0), "rows whose position cannot be read (11)"),
    "-1": (lost(-1.0), "rows whose position cannot be read (11)"),
    "status": (lost([47.3, 9.4]).assign(status=np.where(LOST, "V", "A")), NO_FIX),
    "null": (lost("null"), "11 rows without a position"),
    "header after comments": (
        text("% made by", *("% " * (k == 0) + LINES[k].replace(",", " ") for k in range(ROWS + 1))),
        "headers and comments (1)",
    ),
    "long start": (
        text(*[f"Parameter {k}: {k}, x" for k in range(70)], *LINES),
        "headers and comments (70)",
    ),
    "two names": (
        text(LINES[0], "Time,Latitude,Longitude", "(sec),(deg),(deg)", *LINES[1:]),
        "headers and comments (2)",
    ),
    "two tables": (
        text("name,value", "duration,300", "", *LINES, "", "event,code", "start,1"),
        "rows with another number of cells (2)",
    ),
    "UTF-8": (TEXT.encode() + b"\0" * 400, ""),
    "GPX in Latin": (gpx("ISO-8859-1"), "read as Windows-1252"),
    "photograph without a format": (
        clock(time=dated("%Y:%m:%d %H:%M:%S.%f")),
        NOT + "time='2026:05:13 .*--time-unit",
    ),
    "zone of time": (
        clock(time=dated("%Y-%m-%d %H:%M:%S.%f CEST", 11)),
        SAID + "dates (%Y-%m-%d %H:%M:%S.%f CEST)",
        {"time_unit": "%Y-%m-%d %H:%M:%S.%f CEST"},
    ),
    "17 digits": (
        clock(time=dated("%Y%m%d%H%M%S%f")),
        NOT + "time='20260513115800000' .*--time-unit",
    ),
    "SBS": (
        clock(time=dated("%Y/%m/%d %H:%M:%S")).assign(a="MSG").to_csv(index=False, header=False),
        NOT + "4 columns without names.*--columns",
    ),
    "swapped": (place(LON + 100.0, LAT), NOT + "lat='109.3.*latitudes up to 90 degrees"),
    "KML": (KML, SAID + "dates from 2026-05-13T11:58:00Z"),
    "KML of two": (
        KML.replace("</kml>", KML[KML.index("<Placemark>") :]),
        "2 objects by 'track_id'",
    ),
    "TCX": (TCX, SAID + "dates from 2026-05-13T11:58:00Z"),
    "floating cars": (SUMO, "2 objects by 'id'"),
    "floating cars as a table": (
        plane("vehicle_x", "vehicle_y").rename(columns={"time": "timestep_time"}),
        "'timestep_time' taken as time (--columns)",
    ),
    "GeoJSON of points": (geojson(*POINTS), SAID + "dates from 2026-05-13"),
    "GeoJSON of a line": (geojson(feature(LINE, coordTimes=ISO)), SAID + "dates from 2026-05-13"),
    "GeoJSON of two lines": (
        geojson(feature(LINE, coordTimes=ISO), feature(LINE, coordinateProperties={"times": ISO})),
        "2 objects by 'track_id'",
    ),
    "GeoJSON without times": (geojson(feature(LINE)), NOT + "GeoJSON with times.*ogr2ogr"),
    "lines of JSON": (
        text(*(json.dumps(row) for row in clock(time=ISO).to_dict("records"))),
        SAID + "dates from 2026-05-13",
    ),
    "nested lines of JSON": (
        text(
            *(
                json.dumps({"t": t, "gps": {"lat": a, "lon": b}})
                for t, a, b in zip(T, LAT, LON, strict=True)
            )
        ),
        "tick 2.5 s",
    ),
    "locations": (
        json.dumps({"locations": clock(timestampMs=(1e3 * UNIX).astype(int)).to_dict("records")}),
        SAID + "milliseconds since 1970",
    ),
    "JSON of other things": ('{"time": [1, 2], "x": [1, 2], "y": [3, 4]}', NOT + "nor rows of"),
    "NMEA without times": ("$GPGLL,4916.45,N,12311.12,W,225444,A,*1D\n" * 5, NOT + "RMC or GGA"),
    "damaged JSON": ('{"lat": 1, "lon"\n', NOT + "neither GeoJSON with times nor rows of JSON"),
    "NMEA": (sentences("RMC", "GGA"), NO_FIX),
    "NMEA without dates": (sentences("GGA"), SAID + "times of day"),
    "damaged NMEA": (sentences("RMC", wrong=(7,)), "sentences with a wrong checksum (1)"),
    "AIS without times": (text(*[AIS] * 5), NOT + "AIS sentences without times of reception"),
    "AIS": (ais("{seconds:.3f},{sentence}"), "1 object"),
    "AIS with a time at the end": (ais("{sentence},{date}"), "times are dates"),
    "AIS with tags": (ais("\\g:1-2-3,s:r1,c:{seconds:.3f}*5A\\{sentence}"), "seconds since 1970"),
    "damaged AIS": (ais("{date} {sentence}", wrong=(7,)), "sentences with a wrong checksum (2)"),
    "FIT": (text(FIT, *["Data,0,record,timestamp,1,s"] * 5), NOT + "FitCSVTool: .*--data record"),
    "both in one column": (
        pd.DataFrame({"time": T, "Position": [f"{a}, {b}" for a, b in zip(LAT, LON, strict=True)]}),
        "degrees projected",
    ),
    "both as texts": (
        pd.DataFrame(
            {
                "time": T,
                "coordinates": degrees("{d}°{m}'{s}''{c}").iloc[:, 1:].agg(" ".join, axis=1),
            }
        ),
        "degrees projected",
    ),
    "well-known text": (
        pd.DataFrame(
            {"time": T, "wkt": [f"POINT ({b} {a})" for a, b in zip(LAT, LON, strict=True)]}
        ),
        "degrees projected",
    ),
    "another clock": (
        clock(**{"acquisition time": dated("%Y-%m-%d %H:%M:%S.%f")}),
        "'acquisition time' taken as time",
    ),
    "topics": (
        plane("/pose/position/x", "/pose/position/y").rename(columns={"time": "__time"}),
        "",
    ),
    "plane": (plane("x", "y"), ASSUMED),
    "plane that is said": (plane("x", "y"), "tick 2.5 s", {"frame": "enu"}),
    "compass": (plane("east [m]", "north [m]"), ""),
    "north first": (plane("y", "x"), NED, {"frame": "ned"}),
    "autopilot": (plane("y", "x", z=-20.0, **VELOCITY), NED),
    "autopilot on the ground": (plane("y", "x", z=0.1, xy_valid=1, **VELOCITY), NED),
    "robot": (plane("x", "y", z=0.3, **VELOCITY), ASSUMED),
    "words as z": (plane("x", "y", z="high", **VELOCITY), ASSUMED),
    "MAVLink": (plane("local_position_ned.y", "local_position_ned.x"), NED),
    "pixels": (
        plane("x", "y").assign(y=-NORTH).rename(columns=lambda c: c + " [px]" * (c != "time")),
        "y points down",
    ),
    "image": (plane("x", "y").assign(y=-NORTH), "y points down", {"frame": "image"}),
    "earth-centred": (pd.DataFrame({"time": T} | ECEF), "earth-centred (ECEF)"),
    "earth-centred without z": (plane("x", "y"), NOT + "has no z", {"frame": "ecef"}),
    "another frame": (plane("x", "y"), NOT + "frame='up'.*one of enu, ned", {"frame": "up"}),
    "frame of a compass": (plane("east", "north"), NOT + "frame='ned'", {"frame": "ned"}),
    "frame of degrees": (clock(time=T), NOT + "frame='ned'", {"frame": "ned"}),
    "two zones": (
        pd.DataFrame({"time": T, "easting": UTM[:, 0], "northing": UTM[:, 1], "zone": ZONES}),
        "UTM positions of several zones",
    ),
    "quality": (lost([47.3, 9.4]).assign(quality=np.where(LOST, 0, 4)), NO_FIX),
    "dilution": (lost([47.3, 9.4]).assign(hdop=np.where(LOST, 99.99, 1.2)), NO_FIX),
    "players": (players(), "3 objects by 'player'"),
    "teams": (
        pd.concat(
            [
                players(names=(1, 2)).assign(team=team, y=lambda rows, k=k: rows.y + 90.0 * k)
                for k, team in enumerate("AB")
            ]
        ).sort_values("time", kind="stable"),
        "4 objects by 'player and team'",
    ),
    "one name for a ship that is rarely heard": (ships(3.0), "8 jumps 48 times between"),
}


# Measurements that cannot be read.
FEWER = {
    "clock that is set late": 8,
    "one ahead": 1,
    "damaged NMEA": 12,
    "damaged AIS": 1,
} | dict.fromkeys(
    [
        *("AIS without a position", "zeros", "-1", "status", "null"),
        *("NMEA", "NMEA without dates", "quality", "dilution"),
    ],
    11,
)


@pytest.mark.parametrize("name", CASES)
def test_what_people_have_is_read_or_refused_with_advice(read, name):
    content, said, options = (*CASES[name], {})[:3]
    if said.startswith(NOT):
        with pytest.raises(ArgumentError, match=said.removeprefix(NOT)):
            read(content, **options)
        return
    file = read(content, **options)
    assert said in " ".join([file.summary, *file.warnings])
    for recording in file.recordings:
        assert recording.time_unit == "s"
        rows = recording.measured
        assert rows.sum() == ROWS - FEWER.get(name, 0)
        times = recording.times[rows] - recording.times[0] + T[file.left_out.get(NO_TIME, 0)]
        places = np.searchsorted(T, times - 0.5 * STEP)
        np.testing.assert_allclose(times, T[places], atol=2e-3)
        apart = recording.positions[rows] - np.column_stack([EAST, NORTH])[places]
        assert np.abs(apart - np.median(apart, axis=0)).max() < 0.2


@pytest.mark.parametrize("fill", [-999, 9999, 0])
def test_numbers_in_place_of_positions_on_a_plane(read, fill):
    frame = pd.DataFrame({"time": T, "x": X + 800.0, "y": Y + 400.0})
    [expected] = read(frame[~LOST], unit="m").recordings
    frame.loc[LOST, ["x", "y"]] = fill
    [recording] = read(frame, unit="m").recordings
    np.testing.assert_array_equal(recording.positions[recording.measured], expected.positions)
