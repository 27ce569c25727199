"""Simulated recordings of objects of very different speed and size, for the tests of tracking."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from baselines.recordings.projection import Projection
from hybrid_env.simulation import simulate

MODES = "RLSLSRLRSLSRLS"
LENGTHS = (60, 80, 50, 90, 70, 60, 100, 50, 60, 80, 70, 60, 90, 80)
TRUE_MODES = np.array(["SLR".index(mode) for mode in MODES])


def directions(headings):
    """Unit vectors (..., 2) of headings (...) from the x axis [rad]."""
    return np.stack([np.cos(headings), np.sin(headings)], axis=-1)


def follow(tracker, times, positions):
    """What a live tracker returns at each position (T, 2)."""
    return [tracker.update(tuple(z), time) for z, time in zip(positions, times, strict=True)]


def write_recording(path, times, positions, **more):
    """Write a file of times and positions (T, 2), and return its path."""
    x, y = positions.T
    pd.DataFrame({"time": times, "x": x, "y": y, **more}).to_csv(path, index=False)
    return path


@dataclass(frozen=True)
class Object:
    """An object and its sensor.

    Attributes:
        speed: [m/s].
        radius: of its turns [m].
        tau: tick [s].
        deviation: of a measured coordinate [m].
        noise: Q tau^2 / R.
    """

    speed: float
    radius: float
    tau: float
    deviation: float
    noise: float = 1e-3

    @property
    def measurement_variance(self):
        return self.deviation**2

    @property
    def process_variance(self):
        return self.noise * self.measurement_variance / self.tau**2

    @property
    def start(self):
        return (0.0, 0.0, 0.0, self.speed)

    def options(self, kind, **more):
        """Options of an environment or a tracker of the object."""
        return kind(
            radii=(self.radius,),
            speed=self.speed,
            tau=self.tau,
            process_variance=self.process_variance,
            measurement_variance=self.measurement_variance,
            **more,
        )

    def times(self, ticks):
        return self.tau * np.arange(1, ticks + 1)

    def simulate(self, runs=1, seed=1, modes=MODES, lengths=LENGTHS):
        """Simulation of the modes, (runs, T, 2) measurements."""
        words = [
            f"{m}{n}" + ("" if m == "S" else f"r{self.radius}")
            for m, n in zip(modes, lengths, strict=True)
        ]
        return simulate(
            " ".join(words),
            runs,
            seed,
            start=self.start,
            tau=self.tau,
            process_variance=self.process_variance,
            measurement_variance=self.measurement_variance,
        )

    def geographic(self, latitude, longitude, seed=1):
        """A recording in latitudes and longitudes with dates, and its true modes."""
        [run] = self.simulate(1, seed).measurements
        seconds = pd.to_timedelta(np.round(self.times(len(run)), 3), unit="s")
        dates = pd.Timestamp("2026-05-01T23:50:00") + seconds
        lat, lon = Projection(latitude, longitude).inverse(*run.T).round(8).T
        time = [date.isoformat(timespec="milliseconds") + "Z" for date in dates]
        modes = np.repeat([*MODES], LENGTHS)
        return pd.DataFrame({"time": time, "lat": lat, "lon": lon, "mode": modes})


PIECES = (60, 50, 40, 70)


def drive():
    """Times and measured positions (220, 2) of a car that turns as R60 L50 S40 L70."""
    car = OBJECTS["car"]
    return car.times(220), car.simulate(1, 3, "RLSL", PIECES).measurements[0]


OBJECTS = {
    "readme": Object(2.0, 5.0, 0.1, np.sqrt(0.1), 1e-4),
    "walker": Object(1.4, 10.0, 1.0, 1.0),
    "car": Object(20.0, 200.0, 1.0, 2.0),
    "aircraft": Object(250.0, 5000.0, 1.0, 10.0),
    "ship": Object(8.0, 500.0, 10.0, 8.0),
}
