"""A made-up flight of a glider in a wind, and its log in the IGC format."""

import numpy as np
from pyproj import Proj

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


def fly(seed, plan=PLAN, wind=(3.0, -1.0), speed=10.0, rate=18.0, noise=0.3):
    """Modes (n,), positions (n, 2) and altitudes (n,) at every second, with 3 s to roll in."""
    generator = np.random.default_rng(seed)
    modes = np.repeat(
        [mode for mode, _ in plan],
        [seconds for _, seconds in plan],
    )
    wanted = np.radians(rate) * np.array([0.0, 1.0, -1.0])[modes]
    rates = np.convolve(
        np.pad(wanted, (3, 0), "edge"),
        np.ones(4) / 4.0,
        "valid",
    )
    heading = np.cumsum(rates) + generator.uniform(0.0, 2.0 * np.pi)
    velocity = speed * np.column_stack([np.cos(heading), np.sin(heading)]) + wind
    positions = np.cumsum(velocity, axis=0) + noise * generator.standard_normal((len(modes), 2))
    return modes, positions, 1500.0 + np.cumsum(np.where(modes > 0, 1.5, -1.0))


def degrees_of(projection, positions):
    """Latitude and longitude of positions, (n, 2) [m]."""
    plane = Proj(
        proj="aeqd",
        lat_0=projection.latitude,
        lon_0=projection.longitude,
        ellps="WGS84",
    )
    return np.column_stack(plane(*positions.T, inverse=True)[::-1])


def write_log(positions, altitudes, start=43_200, digits=2):
    """The content of a log, with more digits of the minutes in LAD and LOD."""
    lines = ["AXXX001", "HFDTE010100", "HFPLTPILOT:Nobody, N. N.", *["HFXXXREMARK:long"] * 80]
    if digits:
        lines.append(f"I0236{35 + digits:02d}LAD{36 + digits:02d}{35 + 2 * digits:02d}LOD")
    places = degrees_of(PROJECTION, positions)
    for k, ((latitude, longitude), altitude) in enumerate(zip(places, altitudes, strict=True)):
        cells = []
        more = ""
        for degrees, width, letters in (
            (latitude, 2, "NS"),
            (longitude, 3, "EW"),
        ):
            units = round(abs(degrees) * 60_000 * 10**digits)
            whole, rest = divmod(units, 10**digits)
            cells.append(
                f"{whole // 60_000:0{width}d}{whole % 60_000:05d}{letters[int(degrees < 0)]}"
            )
            more += f"{rest:0{digits}d}" if digits else ""
        clock = (start + k) % 86_400
        time = f"{clock // 3600:02d}{clock // 60 % 60:02d}{clock % 60:02d}"
        lines.append(
            f"B{time}{''.join(cells)}A{round(altitude):05d}{round(altitude) + 50:05d}{more}"
        )
    return "\r\n".join([*lines, "GABC", ""]).encode()


def made_up_log(seed, **options):
    """The content of the log of a made-up flight."""
    _, positions, altitudes = fly(seed, **options)
    return write_log(positions, altitudes)
