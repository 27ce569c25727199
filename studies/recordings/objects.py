"""Simulated recordings of objects of very different speed and size, with the true mode of each
row.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid_env import simulate

KINDS = ("uniform", "missing", "irregular", "rough")
"""Uniform ticks; a fifth of the rows is missing; steps are .5 to 1.5 ticks; or Student's t noise,
turns of different radii, which an object begins on larger ones.
"""


class Target(NamedTuple):
    """An object and its sensor."""

    # [m/s]
    speed: float
    # Radius of its turns [m].
    radius: float
    # Tick [s].
    tau: float
    # Standard deviation of a measured coordinate [m].
    deviation: float
    # Q tau^2 / R.
    process: float = 1e-3


TARGETS = {
    "readme": Target(2.0, 5.0, 0.1, 0.1**0.5, 1e-4),
    "walker": Target(1.4, 10.0, 1.0, 1.0),
    "car": Target(20.0, 200.0, 1.0, 2.0),
    "ship": Target(8.0, 500.0, 10.0, 8.0),
    "aircraft": Target(250.0, 5000.0, 1.0, 10.0),
}
"""Objects by name."""

WORLDS = (
    *((name, "uniform") for name in TARGETS),
    ("walker", "missing"),
    ("aircraft", "missing"),
    ("car", "irregular"),
    ("ship", "irregular"),
    ("walker", "rough"),
    ("car", "rough"),
    ("ship", "rough"),
)
"""Object and kind of the recordings."""


class SimulatedRecording(NamedTuple):
    """The n rows of a recording."""

    # (n,) [s]
    times: NDArray[np.float64]
    # (n, 2) [m]
    positions: NDArray[np.float64]
    # (n,) S, L or R.
    modes: NDArray[np.str_]
    # (n, 4) true [x, vx, y, vy] in m and m/s.
    states: NDArray[np.float64]


def record(name: str, kind: str, seed: int, ticks: int = 600) -> SimulatedRecording:
    """Simulate a recording of an object; segments last 25 + geometric 50 ticks.

    Args:
        name: of `TARGETS`.
        kind: of `KINDS`.
        seed: of switches, motion, noise and rows.
        ticks: number of ticks.
    """
    target = TARGETS[name]
    generator = np.random.default_rng(seed)
    # Steps of the simulation in a tick.
    fine = 4 if kind == "irregular" else 1
    words: list[str] = []
    modes = ""
    mode = ""
    while len(modes) < fine * ticks:
        mode = str(generator.choice(list("SLR".replace(mode, ""))))
        length = fine * (25 + int(generator.geometric(0.02)))
        radius = target.radius
        if kind == "rough":
            radius *= generator.uniform(0.7, 1.5)
            # Two ticks each on four and on two times the radius.
            words += _words(mode, 2, 4.0 * radius) + _words(mode, 2, 2.0 * radius)
        words += _words(mode, length - 4 * (kind == "rough"), radius)
        modes += length * mode
    variance = target.deviation**2
    simulation = simulate(
        " ".join(words),
        seed=seed,
        start=(0.0, 0.0, 0.0, target.speed),
        tau=target.tau / fine,
        process_variance=target.process * variance / target.tau**2 / fine,
        measurement_variance=variance,
        noise="student_t 4" if kind == "rough" else "gaussian",
    )
    rows = np.arange(fine * ticks)
    if kind == "missing":
        rows = rows[generator.random(ticks) > 0.2]
    elif kind == "irregular":
        rows = np.cumsum(generator.integers(2, 7, len(rows)))
        rows = rows[rows < fine * ticks]
    times: NDArray[np.float64] = np.array(target.tau / fine * (rows + 1.0), dtype=np.float64)
    return SimulatedRecording(
        times,
        simulation.measurements[0, rows],
        np.array(list(modes))[rows],
        simulation.truth[0, rows],
    )


def _words(mode: str, length: int, radius: float) -> list[str]:
    """Return a segment of a scheme."""
    return [f"{mode}{length}" + ("" if mode == "S" else f"r{radius}")]
