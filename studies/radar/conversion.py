"""Are the filters consistent with the positions into which ranges and bearings are converted?

A bearing error spreads a position along an arc. Its bend is range times the squared bearing
deviation: the farther it is from a straight line, measured in range deviations, the less a normal
law describes the position.
"""

import math
from dataclasses import dataclass

import numpy as np
from rich.progress import track

from hybrid_env import HybridTrackVectorEnv, Radar
from studies.radar.flights import FloatArray
from studies.results import markdown_table

# Largest bend on a track over the range deviation.
BENDS = (0.01, 0.1, 0.25, 0.5, 1.0, 3.0, 10.0)
TICKS = 60


@dataclass(frozen=True)
class Passing:
    """An object that passes a radar straight ahead, nearest in the middle of its way."""

    name: str
    # [m/s]
    speed: float
    # Least distance from the radar, and standard deviation of the range [m].
    distance: float
    deviation: float
    # Time between measurements [s].
    tick: float


OBJECTS = (
    Passing("walker at 20 m", 1.4, 20.0, 0.3, 1.0),
    Passing("car at 300 m", 20.0, 300.0, 1.0, 0.5),
    Passing("ship at 9 km", 8.0, 9260.0, 30.0, 10.0),
    Passing("aircraft at 50 km", 250.0, 50e3, 50.0, 1.0),
)


def squared_errors(passing: Passing, bend: float, tracks: int, seed: int) -> FloatArray:
    """Return the squared error of the estimates of each track, mean over its ticks, in units of the
    covariance that the filter of straight motion states, (tracks,): 4 where it is consistent.
    """
    half = 0.5 * TICKS * passing.tick * passing.speed
    farthest = math.hypot(passing.distance, half)
    radar = Radar(
        range_deviation=passing.deviation,
        bearing_deviation=math.sqrt(bend * passing.deviation / farthest),
        position=(passing.distance, half),
    )
    env = HybridTrackVectorEnv(
        tracks,
        tick_info=True,
        bank_info=True,
        scheme=f"S{TICKS}",
        reset_covariance=False,
        speed=passing.speed,
        tau=passing.tick,
        process_variance=(0.005 * passing.speed) ** 2,
        measurement_variance=passing.deviation**2,
        initial_error=(passing.deviation**2, (0.05 * passing.speed) ** 2),
        sensors=[radar],
    )
    _, info = env.reset(seed=seed)
    total = np.zeros(tracks)
    for _ in range(TICKS):
        error = info["estimates"][:, 0] - info["truth"]
        white = np.linalg.solve(info["covariances"][:, 0], error[..., None])[..., 0]
        total += (error * white).sum(1)
        info = env.step(np.zeros(tracks, np.int64))[4]
    return total / TICKS


def conversion_errors(tracks: int, seed: int) -> dict[str, dict[str, tuple[float, float]]]:
    """Return the mean over tracks and half the width of its 95 % interval, by bend and object."""
    errors: dict[str, dict[str, tuple[float, float]]] = {}
    for bend in track(BENDS, "bends"):
        of_bend = errors[f"{bend:g}"] = {}
        for passing in OBJECTS:
            each = squared_errors(passing, bend, tracks, seed)
            half = 1.96 * each.std(ddof=1) / math.sqrt(tracks)
            of_bend[passing.name] = float(each.mean()), float(half)
    return errors


def conversion_table(errors: dict[str, dict[str, tuple[float, float]]]) -> str:
    """Return the table of `conversion_errors`, in Markdown."""
    rows = [
        (bend, *(f"{mean:.2f} ± {half:.2f}" for mean, half in of_bend.values()))
        for bend, of_bend in errors.items()
    ]
    heads = ("bend / range deviation", *(passing.name for passing in OBJECTS))
    return markdown_table(heads, rows)
