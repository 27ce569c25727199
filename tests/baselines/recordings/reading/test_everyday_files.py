"""One track as everyday loggers write it: what a person reads at once, and what needs an option."""

import numpy as np
import pandas as pd
import pytest

from hybrid_env.checks import ArgumentError

ROWS = 120
STEP = 2.5
T = STEP * np.arange(ROWS)
HEADING = np.cumsum(np.where(np.arange(ROWS) // 30 % 2 == 0, 0.0, 0.1))
X, Y = np.cumsum(30.0 * np.array([np.cos(HEADING), np.sin(HEADING)]), axis=1)
LAT, LON = 47.25 + 9e-6 * Y, 9.3 + 13e-6 * X
DATES = pd.Timestamp("2026-05-13T11:58:00") + pd.to_timedelta(T, unit="s")
UNIX = DATES.to_numpy().astype("datetime64[ms]").astype(np.int64) / 1e3
DAYS = UNIX / 86_400
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


SAID = "times are "
NO_TIME = "rows without a time"
FILES = {
    # Content and what the summary says of it.
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
    "out of range": (lost(999.0), "rows whose position cannot be read (11)"),
    "AIS without a position": (lost([91.0, 181.0]), "rows whose position cannot be read (11)"),
    "zeros": (lost(0.0), "rows whose position cannot be read (11)"),
    "9999": (lost(9999.0), "rows whose position cannot be read (11)"),
    "-1": (lost(-1.0), "rows whose position cannot be read (11)"),
    "status": (
        lost([47.3, 9.4]).assign(status=np.where(LOST, "V", "A")),
        "rows whose position cannot be read (11)",
    ),
    "null": (lost("null"), "11 rows without a position"),
    "no fix": (lost("no fix"), "rows whose position cannot be read (11)"),
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
    "end": (
        text(*LINES, "", "Rows: 120", "Exported by X, version 1.2"),
        "rows with another number of cells (2)",
    ),
    "two tables": (
        text("name,value", "duration,300", "", *LINES, "", "event,code", "start,1"),
        "rows with another number of cells (2)",
    ),
    "UTF-8": (TEXT.encode() + b"\0" * 400, ""),
    "UTF-16": (TEXT.encode("utf-16"), ""),
    "GPX": (gpx(), SAID + "dates from 2026-05-13T11:58:00Z"),
    "GPX in Latin": (gpx("ISO-8859-1"), "read as Windows-1252"),
}


# Measurements that cannot be read.
FEWER = {"clock that is set late": 8, "one ahead": 1} | dict.fromkeys(
    ["out of range", "AIS without a position", "zeros", "9999", "-1", "status", "null", "no fix"],
    11,
)


@pytest.mark.parametrize("name", FILES)
def test_files_that_are_read_without_an_option(read, name):
    content, said = FILES[name]
    expected = read(TEXT, name="expected.csv").recordings[0]
    file = read(content)
    [recording] = file.recordings
    assert said in file.summary
    assert recording.time_unit == "s"
    rows = recording.measured
    assert rows.sum() == ROWS - FEWER.get(name, 0)
    times = recording.times[rows] - recording.times[0] + T[file.left_out.get(NO_TIME, 0)]
    places = np.searchsorted(T, times - 0.5 * STEP)
    np.testing.assert_allclose(times, T[places], atol=2e-3)
    apart = recording.positions[rows] - expected.positions[places]
    assert np.abs(apart - np.median(apart, axis=0)).max() < 0.2


REFUSED = {
    # Content, message, and options with which it is read.
    "photograph": (
        clock(time=dated("%Y:%m:%d %H:%M:%S.%f")),
        "time='2026:05:13 .*--time-unit",
        {"time_unit": "%Y:%m:%d %H:%M:%S.%f"},
    ),
    "zone": (
        clock(time=dated("%Y-%m-%d %H:%M:%S.%f CEST", 11)),
        "time='2026-05-13 .*--time-unit",
        {"time_unit": "%Y-%m-%d %H:%M:%S.%f CEST"},
    ),
    "17 digits": (
        clock(time=dated("%Y%m%d%H%M%S%f")),
        "time='20260513115800000' .*--time-unit",
        {"time_unit": "%Y%m%d%H%M%S%f"},
    ),
    "SBS": (
        clock(time=dated("%Y/%m/%d %H:%M:%S")).assign(a="MSG").to_csv(index=False, header=False),
        "4 columns without names.*--columns",
        {"columns": {"time": "1", "lat": "2", "lon": "3"}},
    ),
    "other names": (
        place(LAT, LON, "a", "b"),
        "no columns x and y.*its columns are Zeit, a, b.*--columns",
        {"columns": {"lat": "a", "lon": "b"}},
    ),
    "swapped": (place(LON + 100.0, LAT), "lat='109.3.*latitudes up to 90 degrees", None),
    "in one column": (
        pd.DataFrame({"time": T, "Position": [f"{a}, {b}" for a, b in zip(LAT, LON, strict=True)]}),
        "no columns x and y.*its columns are time, Position",
        None,
    ),
    "GPX cut off": (gpx()[:-900], "begins as XML but is not GPX", None),
    "GPX with a free ampersand": (gpx().replace(b"<name>", b"<name>A & "), "is not GPX", None),
    "KML": (b"<?xml version='1.0'?><kml></kml>", "expected a GPX file with points", None),
    "JSON": ('{"type": "FeatureCollection"}\n', "not .*JSON", None),
    "NMEA": ("$GPRMC,101500,A,4700.0003,N,00800.0011,E,0.5,54.7,010526,,*1F\n", "NMEA", None),
}


@pytest.mark.parametrize("name", REFUSED)
def test_files_that_need_an_option_or_another_program(read, name):
    content, message, options = REFUSED[name]
    with pytest.raises(ArgumentError, match=message):
        read(content)
    if options:
        assert len(read(content, **options).recordings[0].times) > 100


def test_days_of_a_calendar_need_their_unit(read):
    frame = clock(Time=(DAYS + 25_569.0).round(9))
    [recording] = read(frame, time_unit="d").recordings
    np.testing.assert_allclose(np.diff(recording.times), STEP, atol=1e-3)


@pytest.mark.parametrize("fill", [-999, 9999, 0])
def test_numbers_in_place_of_positions_on_a_plane(read, fill):
    frame = pd.DataFrame({"time": T, "x": X + 800.0, "y": Y + 400.0})
    [expected] = read(frame[~LOST], unit="m").recordings
    frame.loc[LOST, ["x", "y"]] = fill
    [recording] = read(frame, unit="m").recordings
    np.testing.assert_array_equal(recording.positions[recording.measured], expected.positions)


@pytest.mark.parametrize("stands", [False, True])
def test_positions_that_are_there_several_times(read, stands):
    """A source that is slower than its logger repeats them, and an object that stands."""
    rows = np.arange(ROWS)
    held = np.where((rows > 60) & (rows < 70), 60, rows) if stands else 5 * (rows // 5)
    [recording] = read(pd.DataFrame({"time": T, "x": X[held], "y": Y[held]}), unit="m").recordings
    np.testing.assert_array_equal(recording.times, T if stands else T[::5])
