"""A made-up flight of a glider in a wind, and its log in the IGC format."""

import numpy as np
from pyproj import Proj
from recorded_tracks import directions

from baselines.recordings.projection import Projection

STRAIGHT, LEFT, RIGHT = 0, 1, 2
PLAN = (
    (STRAIGHT, 90),
    (LEFT, 80),
    (STRAIGHT, 70),
    (RIGHT, 60),
    (STRAIGHT, 60),
    (RIGHT, 90),
    (LEFT, 70),
    (STRAIGHT, 80),
)
PROJECTION = Projection(46.5, 9.25)


def fly(seed, noise=0.3):
    """Modes (n,), positions (n, 2) and altitudes (n,) at every second, with 3 s to roll in, of
    circles of 18 deg/s at 10 m/s.
    """
    generator = np.random.default_rng(seed)
    modes = np.repeat(*np.transpose(PLAN))
    wanted = np.radians(18.0) * np.array([0.0, 1.0, -1.0])[modes]
    rates = np.convolve(np.pad(wanted, (3, 0), "edge"), np.ones(4) / 4.0, "valid")
    heading = np.cumsum(rates) + generator.uniform(0.0, 2.0 * np.pi)
    velocity = 10.0 * directions(heading) + (3.0, -1.0)
    positions = np.cumsum(velocity, axis=0) + noise * generator.standard_normal((len(modes), 2))
    return (modes, positions, 1500.0 + np.cumsum(np.where(modes > 0, 1.5, -1.0)))


def degrees_of(projection, positions):
    """Latitude and longitude of positions, (n, 2) [m]."""
    plane = Proj(proj="aeqd", lat_0=projection.latitude, lon_0=projection.longitude, ellps="WGS84")
    return np.column_stack(plane(*positions.T, inverse=True)[::-1])


def write_log(positions, altitudes, digits=2):
    """The content of a log from noon, with more digits of the minutes in LAD and LOD."""
    lines = ["AXXX001", "HFDTE010100", "HFPLTPILOT:Nobody, N. N.", *["HFXXXREMARK:long"] * 80]
    if digits:
        lines.append(f"I0236{35 + digits:02d}LAD{36 + digits:02d}{35 + 2 * digits:02d}LOD")
    places = degrees_of(PROJECTION, positions)
    for k, (place, altitude) in enumerate(zip(places, altitudes, strict=True)):
        fields = more = ""
        for degrees, width, letters in zip(place, (2, 3), ("NS", "EW"), strict=True):
            degree = 60_000 * 10**digits
            units = f"{round(abs(degrees) * degree) % degree:0{5 + digits}d}"
            fields += f"{int(abs(degrees)):0{width}d}{units[:5]}{letters[int(degrees < 0)]}"
            more += units[5:]
        clock = 43_200 + k
        time = f"{clock // 3600:02d}{clock // 60 % 60:02d}{clock % 60:02d}"
        lines.append(f"B{time}{fields}A{round(altitude):05d}{round(altitude) + 50:05d}{more}")
    return "\r\n".join([*lines, "GABC", ""]).encode()


def made_up_log(seed):
    """The content of the log of a made-up flight."""
    _, positions, altitudes = fly(seed)
    return write_log(positions, altitudes)
