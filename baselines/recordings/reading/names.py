"""What the names of columns mean."""

import functools
import re
from collections.abc import Sequence

from hybrid_env.checks import reject

# Value of --object for a file with one object, and of --columns for a role that is not read.
ONE_OBJECT = "none"
# Rows of the results of a recording, as CSV and as Parquet.
ROW_FILES = ("estimates.csv", "estimates.parquet")

ROLE_OF = {
    name: role
    for role, names in {
        "time": (
            "t time times timestamp datetime date_time epoch ts unix unixtime unix_time posix utc"
            " elapsed elapsed_time basedatetime base_date_time date_time_utc sec secs seconds"
            " millis milliseconds second gps_time utc_time time_utc time_gps time_of_day local_time"
            " time_boot tow gps_sow sow gpsseconds gps_seconds gpstime updatetime fly_time"
            " offset_time tst now global_time timestamp_external trial_time position_t stamp"
            " zeit uhrzeit zeitstempel fecha_hora hora heure horodatage ora tijd tid klockslag czas"
            " время 时间 時間 時刻 日時"
        ),
        "date": ("date gps_date utc_date date_utc local_date datum fecha data dato дата 日期 日付"),
        "fix_time": (
            "lastposupdate last_position_update time_position position_time pos_time fix_time"
            " gps_fix_time"
        ),
        "x": (
            "x easting east e pos_x x_pos posx position_x x_position px utm_easting utm_e utm_x"
            " x_coordinate coord_x ost rechtswert x_center local_x vehicle_x person_x ecef_x x_ecef"
            " pixel_x x_pixel x_ned x_enu ned_x enu_x pos_e pos_east position_east x_east y_east"
            " east_x"
        ),
        "y": (
            "y northing north n pos_y y_pos posy position_y y_position py utm_northing utm_n utm_y"
            " y_coordinate coord_y nord hochwert y_center local_y vehicle_y person_y ecef_y y_ecef"
            " pixel_y y_pixel y_ned y_enu ned_y enu_y pos_n pos_north"
            " position_north x_north y_north north_y"
        ),
        # Of earth-centred, earth-fixed positions; otherwise the altitude.
        "z": (
            "z pos_z z_pos posz position_z z_position pz ecef_z z_ecef z_ned ned_z alt altitude"
            " altitudes enhanced_altitude ele elevation height altitude_meters geoaltitude"
            " geo_altitude baroaltitude baro_altitude alt_geom alt_baro gps_altitude gps_alt"
            " altitude_msl amsl msl flight_level fl höhe hoehe altura altitud hauteur quota hoogte"
            " wysokosc высота 高度 海拔"
        ),
        # Latitude and longitude in one cell.
        "position": (
            "position positions pos coordinate coordinates coords location latlon latlng lat_lon"
            " lat_lng lat_long latitude_longitude gps gps_position gps_coordinates koordinaten"
            " coordonnées coordenadas wkt geom geometry"
        ),
        "zone": "utm_zone zone zone_number utm_zone_number",
        "lat": (
            "lat latitude lats latitudes location_lat position_lat gps_lat gps_latitude latitudee7"
            " breite breitengrad geo_breite latitud latitudine breedtegraad szerokosc bredde"
            " breddegrad широта 纬度 緯度"
        ),
        "lon": (
            "lon lng long longitude lons longitudes location_long location_lon position_long"
            " position_lon gps_lon gps_lng gps_long gps_longitude longitudee7 länge laenge"
            " längengrad laengengrad geo_länge longitud longitudine lengtegraad dlugosc lengde"
            " lengdegrad долгота 经度 経度"
        ),
        "north_south": "n_s ns lat_dir lat_hemisphere latitude_hemisphere ns_indicator",
        "east_west": "e_w ew lon_dir lon_hemisphere longitude_hemisphere ew_indicator",
        "range": "range rng rho distance slant_range measured_range",
        "bearing": "bearing brg azimuth az measured_bearing",
        "rate": "range_rate rangerate doppler radial_velocity radial_speed rdot",
        "vx": (
            "vx v_x vel_x velocity_x x_velocity speed_x xvel x_vel xdot ve v_e vel_e velocity_e"
            " velocity_east vel_east east_velocity v_east veast"
        ),
        "vy": (
            "vy v_y vel_y velocity_y y_velocity speed_y yvel y_vel ydot vn v_n vel_n velocity_n"
            " velocity_north vel_north north_velocity v_north vnorth"
        ),
        "speed": (
            "speed sog speed_over_ground ground_speed groundspeed gs gspeed velocity spd speed_kmh"
            " speed_knots speed_kn speed_ms gps_speed enhanced_speed vehicle_speed speedoverground"
            " gnd_spd speed_2d"
        ),
        "course": (
            "course cog course_over_ground track true_track track_angle ground_track direction"
            " angle gps_course courseoverground track_deg cog_deg vehicle_angle"
        ),
        # Where the object points to; used where nothing says where it goes.
        "heading": "heading hdg true_heading gps_heading heading_deg",
        "object": (
            "object object_id obj obj_id id track_id trackid target target_id vehicle vehicle_id"
            " agent agent_id ship ship_id mmsi icao24 icao hex callsign flight flight_id individual"
            " individual_local_identifier tag_local_identifier animal animal_id name ped_id"
            " player_id pedestrian_id person person_id pid uid uuid tag tag_id"
        ),
        # Of a file of modes.
        "mode": (
            "mode modes true_mode truth stated statement statements predicted prediction label"
            " labels state states regime class manoeuvre maneuver phase"
        ),
        # The number of the row, as spreadsheets and pandas write it.
        "index": "unnamed_0 index row nr no frame frame_id frame_number",
        # Whether the sensor had a position.
        "valid": (
            "valid visible status gps_status fix fix_type gps_fix gps_fix_type fix_quality gps_qual"
            " gps_quality quality fix_status validity void"
        ),
        # Dilution of precision.
        "dilution": "hdop pdop gdop horizontal_dil dop gps_hdop",
    }.items()
    for name in names.split()
}
"""Roles of columns by their names, which are in lower case and joined by underscores."""

GIVEN_ROLES = (
    *("time", "date", "x", "y", "z", "lat", "lon", "position", "range", "bearing", "rate"),
    *("vx", "vy", "speed", "course"),
)
"""Roles of --columns."""

VOID = "valid", "dilution"
"""Roles of columns, as many as there are, that say whether the sensor had a position."""

SECONDS = {
    name: scale
    for names, scale in (
        ("s sec secs second seconds", 1.0),
        ("ms msec millis millisecond milliseconds", 1e-3),
        ("us µs μs usec microsecond microseconds", 1e-6),
        ("ns nsec nsecs nanosec nanoseconds", 1e-9),
        ("min minute minutes", 60.0),
        ("h hour hours", 3600.0),
        ("d day days", 86_400.0),
    )
    for name in names.split()
}
"""Units of time [s]."""

DEGREES = ("deg", "degree", "degrees", "°")


def plain_name(name: str) -> str:
    """Return a name in lower case, its words joined by underscores."""
    return re.sub(r"[\s_.:/-]+", "_", name.strip(" \t'\"%#").lower()).strip("_")


@functools.lru_cache(maxsize=256)
def split_unit(name: str) -> tuple[str, str | None]:
    """Return the plain name of a column and its unit, None if it has none. The unit is in brackets
    or after a slash, as in `x [m]`, `x (km)` and `t/s`, or a known one after an underscore, as in
    `t_ms`. Of a name such as `OSD.latitude` or `pose.position.x` the last words count.
    """
    # In longer texts, and in many spaces, a search for brackets would take long.
    name = " ".join(name[:200].split())
    words = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name)
    # A letter means nothing without the word before it.
    last = re.findall(r"[^.:/]*[.:/][^.:/]$|[^.:/]*$", words)[0]
    position = r".*(?:pos|local|odom|gps)[^.:/]*[./](?=[xyz](?:\W|$))"
    splits = [_split(text) for text in (name, words, last, re.sub(f"(?i){position}", "", words))]
    return next((split for split in splits if split[0] in ROLE_OF), splits[0])


def _split(name: str) -> tuple[str, str | None]:
    # The signs of latitudes and longitudes are no unit.
    plain = plain_name(re.sub(r"(?i)(?<=\w) +(n/s|e/w)$", "", name))
    if plain in ROLE_OF:
        return plain, plain if plain in SECONDS else None
    lengths = "m km cm mm um ft yd mi nmi px pixel pixels rad mrad mil mils gon grad"
    known = {*lengths.split(), *SECONDS, *DEGREES}
    match = re.fullmatch(r"(.+?)\s*(?:\[(.*)\]|\((.*)\)|/\s*(\w+))", name)
    if match and (match[4] is None or match[4].lower() in known):
        return plain_name(match[1]), "".join(filter(None, match.groups()[1:])).strip() or None
    base, _, unit = plain.rpartition("_")
    return (base, unit) if base and unit in known else (plain, None)


def role_of(name: str) -> str | None:
    """Return the role of a column by its name, None if it has none. A column without a name is an
    index.
    """
    return ROLE_OF.get(split_unit(name)[0]) if name else "index"


def columns_by_role(texts: Sequence[str], roles: Sequence[str]) -> dict[str, str]:
    """Return the columns that texts such as `time=3` name, by role."""
    columns: dict[str, str] = {}
    for text in texts:
        role, sign, column = text.partition("=")
        if not sign or role not in roles or not column:
            raise reject("columns", text, f"role=column with a role of {', '.join(roles)}")
        columns[role] = column
    return columns
