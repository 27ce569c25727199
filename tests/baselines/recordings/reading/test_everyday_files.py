"""Clocks, units, languages and losses of everyday loggers: what a person reads at once."""

import numpy as np
import pandas as pd
import pytest

ROWS = 120
STEP = 2.5
T = STEP * np.arange(ROWS)
HEADING = np.cumsum(np.where(np.arange(ROWS) // 30 % 2 == 0, 0.0, 0.1))
X, Y = np.cumsum(30.0 * np.array([np.cos(HEADING), np.sin(HEADING)]), axis=1)
LAT, LON = 47.25 + 9e-6 * Y, 9.3 + 13e-6 * X
DATES = pd.Timestamp("2026-05-13T11:58:00") + pd.to_timedelta(T, unit="s")
UNIX = DATES.to_numpy().astype("datetime64[ms]").astype(np.int64) / 1e3
GPS = UNIX - 315_964_800 + 18
DAYS = UNIX / 86_400
PLACE = {"lat": LAT.round(7), "lon": LON.round(7)}
LINES = pd.DataFrame({"time": T, **PLACE}).to_csv(index=False).splitlines()
LOST = (T > 100) & (T < 130)


def dated(form, places=3):
    """Dates in a form of strftime, their fraction of a second cut to so many places."""
    texts = DATES.strftime(form)
    return [text[: len(text) - 6 + places] if form.endswith("%f") else text for text in texts]


def degrees(form):
    """Latitude and longitude in degrees, minutes and seconds."""
    texts = []
    for values, letter in ((LAT, "N"), (LON, "E")):
        minutes, seconds = np.divmod(3600.0 * values, 60.0)
        whole, minutes = np.divmod(minutes, 60.0)
        rows = zip(whole.astype(int), minutes.astype(int), seconds, strict=True)
        texts.append([form.format(d=d, m=m, s=f"{s:.4f}", c=letter) for d, m, s in rows])
    return {"lat": texts[0], "lon": texts[1]}


def difference(read, content, **options):
    """Largest errors of times [s] and positions [m], of a file of the track."""
    file = read(content, **options)
    expected = read("\n".join(LINES) + "\n", name="expected.csv").recordings[0]
    [recording] = file.recordings
    assert recording.time_unit == "s"
    first = file.left_out.get("rows without a time", 0)
    times = recording.times - recording.times[0] + T[first]
    rows = np.searchsorted(T, times - 0.5 * STEP)
    apart = recording.positions - expected.positions[rows]
    apart -= np.median(apart, axis=0)
    return np.abs(times - T[rows]).max(), np.hypot(*apart.T).max(), file


CLOCKS = {
    "Excel": {"Time": (DAYS + 25_569).round(9)},
    "Julian": {"jd": [f"{day + 2_440_587.5:.9f}" for day in DAYS]},
    "modified Julian": {"mjd": (DAYS + 40_587).round(9)},
    "Matlab": {"time": [f"{day + 719_529:.9f}" for day in DAYS]},
    "GPS weeks": {"GPS_Week": GPS // 604_800, "TOW": GPS % 604_800},
    "GPS milliseconds": {"GWk": GPS // 604_800, "GMS": 1e3 * (GPS % 604_800)},
    "milliseconds beside": {
        "time": dated("%Y-%m-%d %H:%M:%S"),
        "ms": (1000.0 * T % 1000).astype(int),
    },
    "nanoseconds beside": {"secs": UNIX // 1, "nsecs": (1e9 * (T % 1.0)).astype(int)},
    "comma before milliseconds": {"time": dated("%Y-%m-%d %H:%M:%S,%f")},
    "colon before milliseconds": {"time": dated("%H:%M:%S:%f")},
    "zone": {"time": [f"{text} CEST" for text in dated("%Y-%m-%d %H:%M:%S.%f")]},
    "offset": {"time": [f"{text} UTC+02:00" for text in dated("%Y-%m-%d %H:%M:%S.%f")]},
    "12 hours": {
        "time": [
            f"{text} {half}"
            for text, half in zip(dated("%m/%d/%Y %I:%M:%S.%f"), dated("%p"), strict=True)
        ]
    },
    "month": {"time": dated("%d-%b-%Y %H:%M:%S.%f")},
    "two digits": {"time": dated("%d/%m/%y %H:%M:%S.%f")},
    "photograph": {"time": dated("%Y:%m:%d %H:%M:%S.%f")},
    "17 digits": {"time": dated("%Y%m%d%H%M%S%f")},
    "durations": {"time": [f"0 days 00:{t // 60:02.0f}:{t % 60:04.1f}" for t in T]},
    "minutes and seconds": {"time": [f"{t // 60:02.0f}:{t % 60:04.1f}" for t in T]},
    "parts": {
        name: dated(f"%{letter}")
        for name, letter in (("YYYY", "Y"), ("MM", "m"), ("DD", "d"), ("hh", "H"), ("mm", "M"))
    }
    | {"ss": dated("%S.%f")},
    "PX4": {"timestamp": UNIX.astype(int) // 5, "time_utc_usec": (1e6 * UNIX).astype(np.int64)},
    "PX4 without a date": {"timestamp": (1e6 * T).astype(int) + 51_234_567},
    "DJI": {"time(millisecond)": 1e3 * T, "datetime(utc)": dated("%Y-%m-%d %H:%M:%S")},
    "German": {"Datum": dated("%d.%m.%Y"), "Uhrzeit": dated("%H:%M:%S.%f")},
    "Spanish": {"Fecha": dated("%d/%m/%Y"), "Hora": dated("%H:%M:%S.%f")},
    "dates of a clock that is set late": {
        "time": np.where(T < 20.0, "1970-01-01T00:00:00.000", dated("%Y-%m-%dT%H:%M:%S.%f"))
    },
    "one ahead": {"timestamp": UNIX + 3600.0 * (T == 50.0)},
}


@pytest.mark.parametrize("clock", CLOCKS)
def test_clocks(read, clock):
    of_times, of_positions, _ = difference(read, pd.DataFrame(CLOCKS[clock] | PLACE))
    assert of_times < 2e-3
    assert of_positions < 0.1


@pytest.mark.parametrize("minutes", [1, 5, 60])
def test_minutes_in_excel(read, minutes):
    days = DAYS[0] + 25_569 + minutes * np.arange(ROWS) / 1440.0
    [recording] = read(pd.DataFrame({"Time": days.round(7), **PLACE})).recordings
    np.testing.assert_allclose(np.diff(recording.times), 60.0 * minutes, atol=0.02)


def named(*names):
    return dict(zip(names, PLACE.values(), strict=True))


PLACES = {
    "1e-5": {name: (1e5 * values).round().astype(int) for name, values in PLACE.items()},
    "1e-6": {name: (1e6 * values).round().astype(int) for name, values in PLACE.items()},
    "E7": {
        "latitudeE7": (1e7 * LAT).round().astype(int),
        "longitudeE7": (1e7 * LON).round().astype(int),
    },
    "radians": {"lat_rad": np.radians(LAT), "lon_rad": np.radians(LON)},
    "primes": degrees("{d}° {m}\u2032 {s}\u2033 {c}"),
    "spaces": degrees("{c}{d} {m} {s}"),
    "colons": degrees("{d}:{m}:{s}{c}"),
    "letters": degrees("{d}d{m}m{s}s"),
    "words": {"lat": [f"{v:.7f} North" for v in LAT], "lon": [f"{v:.7f} East" for v in LON]},
    "GeoJSON": {
        "geometry": [
            f'{{"type": "Point", "coordinates": [{b:.7f}, {a:.7f}]}}'
            for a, b in zip(LAT, LON, strict=True)
        ]
    },
    "pair": {"GPS": [f"{a:.7f} {b:.7f}" for a, b in zip(LAT, LON, strict=True)], "Alt": 4.0},
    "Breite": named("Breite", "Länge"),
    "latitud": named("Latitud", "Longitud"),
    "широта": named("Широта", "Долгота"),
    "纬度": named("纬度", "经度"),
    "OSD": named("OSD.latitude", "OSD.longitude") | {"HOME.latitude": 47.0, "HOME.longitude": 9.0},
    "gpsLat": named("gpsLat", "gpsLon"),
    "two receivers": named("GPS(0):Lat", "GPS(0):Long") | {"GPS(1):Lat": LAT, "GPS(1):Long": LON},
}


@pytest.mark.parametrize("place", PLACES)
def test_places(read, place):
    content = pd.DataFrame({"Zeit": T} | PLACES[place])
    _, of_positions, _ = difference(read, content)
    assert of_positions < (1.5 if place == "1e-5" else 0.2)


def test_swapped_latitude_and_longitude(read):
    frame = pd.DataFrame({"time": T, "lat": LON + 100.0, "lon": LAT})
    file = read(frame)
    right = read(frame.rename(columns={"lat": "lon", "lon": "lat"}))
    np.testing.assert_array_equal(file.recordings[0].positions, right.recordings[0].positions)
    assert "latitude and longitude are swapped" in file.summary


@pytest.mark.parametrize(
    "fill", [-999, 9999, 0, "null", "N/A", "-", "no fix", (91, 181), ("status", "V"), ("fix", 0)]
)
@pytest.mark.parametrize("plane", [False, True])
def test_fills_in_place_of_positions(read, fill, plane):
    frame = (
        pd.DataFrame({"time": T, "x": X + 800.0, "y": Y + 400.0})
        if plane
        else pd.DataFrame({"time": T, **PLACE})
    )
    columns = list(frame.columns[1:])
    expected = read(frame[~LOST], unit="m").recordings[0]
    if isinstance(fill, tuple) and isinstance(fill[0], str):
        frame[fill[0]] = np.where(LOST, fill[1], "A" if fill[1] == "V" else 3)
        frame.loc[LOST, columns] += 0.5
    elif isinstance(fill, tuple) and plane:
        pytest.skip("no angles")
    else:
        frame = frame.astype(object)
        frame.loc[LOST, columns] = fill
    recording = read(frame, unit="m").recordings[0]
    measured = recording.measured
    assert measured.sum() == (~LOST).sum()
    np.testing.assert_allclose(recording.positions[measured], expected.positions, atol=1e-6)


@pytest.mark.parametrize("rows", [5, 2])
def test_the_last_position_in_a_tunnel_is_no_measurement(read, rows):
    """Also where every position is there for five rows; an object that stands is measured."""
    held = np.arange(ROWS)
    held[60:70] = 60
    if rows == 5:
        held = rows * (np.arange(ROWS) // rows)
    [recording] = read(pd.DataFrame({"time": T, "x": X[held], "y": Y[held]}), unit="m").recordings
    np.testing.assert_array_equal(recording.times, T[np.unique(held, return_index=True)[1]])


SHAPES = {
    "more delimiters": [line + ",," * (k % 3 == 1) for k, line in enumerate(LINES)],
    "notes": [line + ",low battery" * (k in (20, 90)) for k, line in enumerate(LINES)],
    "quoted lines": [f'"{line}"' for line in LINES],
    "header after comments": ["% made by", "% " + LINES[0].replace(",", " ")]
    + [line.replace(",", " ") for line in LINES[1:]],
    "long start": [*[f"Parameter {k}: {k}, x" for k in range(70)], *LINES],
    "two names": [LINES[0], "Time,Latitude,Longitude", "(sec),(deg),(deg)", *LINES[1:]],
    "end": [*LINES, "", "Rows: 120", "Exported by X, version 1.2"],
    "two tables": ["name,value", "duration,300", "", *LINES, "", "event,code", "start,1"],
    "commas in texts": ["destination," + LINES[0]]
    + [("KIEL," if k % 4 else "KIEL, DE,") + line for k, line in enumerate(LINES[1:])],
    "missing ends": [LINES[0] + ",note"]
    + [line + ",a" * (k % 4 > 0) for k, line in enumerate(LINES[1:])],
}


@pytest.mark.parametrize("shape", SHAPES)
def test_shapes(read, shape):
    of_times, of_positions, _ = difference(read, "\n".join(SHAPES[shape]) + "\n")
    assert of_times == 0.0
    assert of_positions < 1e-6


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-32", "utf-8", "utf-16"])
def test_encodings_and_a_file_with_an_empty_end(read, encoding):
    content = ("\n".join(LINES) + "\n").encode(encoding)
    content += b"\0" * 400 if encoding == "utf-8" else b""
    assert difference(read, content)[1] < 1e-6


@pytest.mark.parametrize("fault", ["none", "cut", "ampersand", "latin", "route", "blank"])
def test_gpx_with_faults(read, fault):
    point, end = (
        ("rtept", "</rte></gpx>") if fault == "route" else ("trkpt", "</trkseg></trk></gpx>")
    )
    start = "<rte>" if fault == "route" else "<trk><name>A & B</name><trkseg>"
    points = [
        f'<{point} lat="{a:.7f}" lon="{b:.7f}"><time>{d.isoformat()}Z</time></{point}>'
        for a, b, d in zip(LAT, LON, DATES, strict=True)
    ]
    text = f'<?xml version="1.0" encoding="{"ISO-8859-1" if fault == "latin" else "UTF-8"}"?><gpx>'
    text = "\n" * (fault == "blank") + text + start + "\n".join(points) + end
    if fault != "ampersand":
        text = text.replace("&", "ö")
    if fault == "cut":
        text = text[:-900]
    file = read(text.encode("latin-1" if fault == "latin" else "utf-8"), name="walk.gpx")
    [recording] = file.recordings
    np.testing.assert_allclose(np.diff(recording.times), STEP)
    assert (len(recording.times) < ROWS) == (fault == "cut")


@pytest.mark.parametrize("kind", ["SBS", "PLT"])
def test_files_whose_columns_have_no_names(read, kind):
    rows = zip(LAT, LON, DATES, strict=True)
    if kind == "SBS":
        lines = [
            f"MSG,3,1,1,4B1815,1,{d:%Y/%m/%d},{d:%H:%M:%S}.{d.microsecond // 1000:03d},,,,3000,,,"
            f"{a:.7f},{b:.7f},,,0,0,0,0"
            for a, b, d in rows
        ]
    else:
        lines = ["Geolife trajectory", "WGS 84", "Altitude", "Reserved 3", "0,2,255,T,0", "0"]
        lines += [
            f"{a:.7f},{b:.7f},0,492,{DAYS[0]},{d:%Y-%m-%d},{d:%H:%M:%S.%f}" for a, b, d in rows
        ]
    of_times, of_positions, _ = difference(read, "\n".join(lines) + "\n")
    assert of_times < 2e-3
    assert of_positions < 0.1
