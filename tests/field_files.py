"""Five files as engineers have them who track objects of the field, with the true mode of each row.

`make` simulates the rows of a file in the order in which they arrive, and `write` writes them:

    rows = make("drone", seed=1, jitter=0.2, repeated=0.05, late=0.05, missing=0.1)
    path = write(rows, tmp_path)
"""

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from made_up_glider import degrees_of
from recorded_tracks import LENGTHS, TRUE_MODES, Object
from scipy.interpolate import CubicHermiteSpline

from baselines.recordings.projection import Projection
from hybrid_env.checks import FloatArray, IntArray

PROJECTION = Projection(47.25, 9.3)
START = pd.Timestamp("2026-05-01T10:00:00")
DRONE = Object(8.0, 16.0, 0.1, 0.1, 1e-4)
ROBOT = Object(0.6, 0.9, 0.1, 0.01, 1e-4)
RUNNER = Object(3.2, 20.0, 1.0, 1.0)
AIRCRAFT = Object(120.0, 3000.0, 4.0, 28.0, 1e-4)
CAR = Object(12.0, 80.0, 1.0, 1.5)
# The true state is simulated every second.
SHIP = Object(8.0, 500.0, 1.0, 5.0, 1e-6)
SHIP_STEPS = 2.0, 30.0

# Standard deviations of the radar: those of range [m] and azimuth [deg].
RANGE_DEVIATION = 28.0
AZIMUTH_DEVIATION = 0.21
# First position of the aircraft, seen from the radar [m].
AIRCRAFT_AT = 30_000.0, -20_000.0
# Seconds without a position in the run, from 400 s on.
GAP = 400.0, 490.0

OBJECTS = {
    "drone": {"drone": DRONE},
    "robot": {"robot": ROBOT},
    "run": {"Morning run": RUNNER},
    "radar": {"radar": AIRCRAFT},
    "harbour": {"car": CAR, "ship": SHIP},
}
"""Objects of each file, by the names under which they are read."""

NAMES = tuple(OBJECTS)


@dataclass(frozen=True, eq=False)
class Rows:
    """The n rows of a file in the order in which they arrive.

    Attributes:
        name: of the file.
        times: (n,) of the measurements [s] since `START`; those that are late go back. A file with
            dates is read with times since the earliest row.
        positions: (n, 2) as the file has them: latitude and longitude [deg] of drone and run, x and
            y [m] of robot and harbour, range [m] and azimuth [deg clockwise from north] of radar.
        modes: (n,) true ones, 0 straight, 1 left, 2 right.
        objects: (n,) names.
    """

    name: str
    times: FloatArray
    positions: FloatArray
    modes: IntArray
    objects: np.ndarray

    def select(self, rows):
        """Return some of the rows, by their numbers or as (n,) booleans."""
        fields = ("times", "positions", "modes", "objects")
        return replace(self, **{field: getattr(self, field)[rows] for field in fields})

    def of(self, name):
        """Return the rows of an object."""
        return self.select(self.objects == name)

    def modes_at(self, times):
        """Return the true modes (k,) at times of rows (k,) of a file with one object."""
        instants, first = np.unique(self.times, return_index=True)
        places = np.searchsorted(instants, np.asarray(times) - 1e-4)
        return self.modes[first[places]]


def make(name, seed, *, jitter=0.0, repeated=0.0, late=0.0, missing=0.0):
    """Return the rows of a file.

    Args:
        name: of `NAMES`.
        seed: of motion, noise and losses.
        jitter: standard deviation of the times [ticks], at most 0.4 of a tick from the clock.
        repeated: share of the rows that arrive twice.
        late: share of the rows that arrive after one to three later ones.
        missing: share of the rows that never arrive.
    """
    generator = np.random.default_rng([NAMES.index(name), seed])
    parts = [
        _of_object(name, who, target, seed, jitter, generator)
        for who, target in OBJECTS[name].items()
    ]
    fields = ("times", "positions", "modes", "objects")
    rows = Rows(name, *(np.concatenate([getattr(part, key) for part in parts]) for key in fields))
    rows = rows.select(np.argsort(rows.times, kind="stable"))
    if name == "run":
        rows = rows.select((rows.times < GAP[0]) | (rows.times > GAP[1]))
    count = len(rows.times)
    rows = rows.select(generator.random(count) >= missing)
    count = len(rows.times)
    behind = np.where(generator.random(count) < late, generator.integers(1, 4, count) + 0.5, 0.0)
    rows = rows.select(np.argsort(np.arange(count) + behind, kind="stable"))
    return rows.select(np.repeat(np.arange(count), 1 + (generator.random(count) < repeated)))


def _of_object(name, who, target, seed, jitter, generator):
    """Return all rows of an object, in the order of their times."""
    lengths = np.array(LENGTHS)
    if target is SHIP:
        lengths *= int(np.mean(SHIP_STEPS))
    if target is AIRCRAFT:
        # It stays in the range of the radar.
        lengths //= 2
    truth = target.simulate(1, seed, lengths=lengths).truth[0]
    ticks = target.times(len(truth))
    times = ticks
    if target is SHIP:
        steps = generator.uniform(*SHIP_STEPS, len(truth))
        times = np.cumsum(steps)
        times = times[times < ticks[-1] - 1.0] + 1.0
    moved = target.tau * np.clip(jitter * generator.standard_normal(len(times)), -0.4, 0.4)
    # Clocks have milliseconds.
    times = np.round(np.clip(times + moved, ticks[0], ticks[-1]), 3)
    points = CubicHermiteSpline(ticks, truth[:, ::2], truth[:, 1::2])(times)
    noise = generator.standard_normal((len(times), 2))
    if name == "radar":
        away = points + AIRCRAFT_AT
        azimuths = np.degrees(np.arctan2(away[:, 0], away[:, 1])) + AZIMUTH_DEVIATION * noise[:, 1]
        ranges = np.hypot(*away.T) + RANGE_DEVIATION * noise[:, 0]
        positions = np.round(np.column_stack([ranges, azimuths % 360.0]), 3)
    else:
        points = points + target.deviation * noise
        degrees = name in ("drone", "run")
        positions = np.round(degrees_of(PROJECTION, points), 8) if degrees else np.round(points, 4)
    pieces = np.repeat(TRUE_MODES, lengths)
    # The mode of a tick is that of the step to it.
    modes = pieces[np.searchsorted(ticks, times - 1e-6)]
    return Rows(name, times, positions, modes, np.full(len(times), who))


def write(rows, folder):
    """Write the file of rows, in the order in which they arrive, and return its path."""
    path = folder / f"{rows.name}.{'gpx' if rows.name == 'run' else 'csv'}"
    path.write_text(_WRITERS[rows.name](rows), encoding="utf-8")
    return path


def iso_times(rows):
    """Return times as ISO 8601 with milliseconds, (n,)."""
    dates = START + pd.to_timedelta(rows.times, unit="s").round("ms")
    return [f"{date.isoformat(timespec='milliseconds')}Z" for date in dates]


def _drone(rows):
    frame = pd.DataFrame(
        {
            "timestamp": iso_times(rows),
            "latitude": rows.positions[:, 0],
            "longitude": rows.positions[:, 1],
            "altitude": 120.0,
            "battery_percent": 87,
        }
    )
    return frame.to_csv(index=False, float_format="%.8f")


def _robot(rows):
    frame = pd.DataFrame({"time": rows.times}).assign(
        **{"x [m]": rows.positions[:, 0], "y [m]": rows.positions[:, 1]}
    )
    return frame.to_csv(index=False, sep=";", decimal=",", float_format="%.4f")


def _run(rows):
    points = [
        f'   <trkpt lat="{latitude:.8f}" lon="{longitude:.8f}"><ele>431.2</ele>'
        f"<time>{time}</time></trkpt>"
        for time, (latitude, longitude) in zip(iso_times(rows), rows.positions, strict=True)
    ]
    return "\n".join(
        [
            '<?xml version="1.0" encoding="UTF-8"?>',
            '<gpx version="1.1" creator="watch" xmlns="http://www.topografix.com/GPX/1/1">',
            f" <trk><name>{rows.objects[0]}</name><trkseg>",
            *points,
            " </trkseg></trk>",
            "</gpx>",
            "",
        ]
    )


def _radar(rows):
    ranges, azimuths = rows.positions.T
    frame = pd.DataFrame({"time_s": rows.times, "range_m": ranges, "azimuth_deg": azimuths})
    return frame.to_csv(index=False, float_format="%.3f")


def _harbour(rows):
    frame = pd.DataFrame(
        {
            "time": iso_times(rows),
            "object": rows.objects,
            "x": rows.positions[:, 0],
            "y": rows.positions[:, 1],
        }
    )
    return frame.to_csv(index=False, float_format="%.4f")


_WRITERS = {"drone": _drone, "robot": _robot, "run": _run, "radar": _radar, "harbour": _harbour}
