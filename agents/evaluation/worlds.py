"""Environments other than the nominal one: with one property changed, and random ones.

Random worlds have objects, sensors and banks of many kinds, without units.
"""

from typing import Any

import numpy as np
from numpy.random import Generator

from baselines.recordings.log_uniform import log_uniform
from hybrid_env.options import WorldOptions
from hybrid_env.scheme import RandomScheme

NOMINAL = "nominal"
RHYTHMS: dict[str, dict[str, Any]] = {
    NOMINAL: {},
    **{
        law: {"durations": law}
        for law in (
            "uniform 40-45",
            "uniform 63-67",
            "uniform 90-100",
            "uniform 30-60",
            "60 + geometric 20",
            "uniform 150-170",
            "uniform 28-32 or uniform 75-85",
            "uniform 50-53 or 20 + geometric 60",
            "straight uniform 90-100, turns uniform 40-44",
            "straight 25 + geometric 50, turns uniform 50-54",
        )
    },
    "nominal, cycle": {"order": "cycle"},
    "uniform 55-60, habits": {"durations": "uniform 55-60", "order": "0 0.9 0.1, 0.2 0 0.8, 1 0 0"},
}
"""Habits of an object whose switches are unknown. The adaptive beam has none of these laws in
its prior.
"""


def shifted_worlds(world: WorldOptions) -> dict[str, dict[str, Any]]:
    """Return name and changed options of the environments around the nominal one, the nominal
    one first.
    """
    R = np.asarray(world.measurement_variance)
    Q = world.process_variance
    position, velocity = (
        world.initial_error if isinstance(world.initial_error, tuple) else (0.0, 0.0)
    )
    mean = float(np.exp(np.log(R).mean()))
    shifts: dict[str, dict[str, Any]] = {
        NOMINAL: {},
        "R / 100": {"measurement_variance": _plain(R / 100)},
        "R / 10": {"measurement_variance": _plain(R / 10)},
        "R x 10": {"measurement_variance": _plain(R * 10)},
        "R of y is 16 R of x": {"measurement_variance": (mean / 4, mean * 4)},
        "Q / 10": {"process_variance": Q / 10},
        "Q x 10": {"process_variance": 10 * Q},
        "2 % outliers": {"noise": "outliers 0.02"},
        "5 % outliers": {"noise": "outliers 0.05"},
        "Student's t noise": {"noise": "student_t 3"},
        "Lévy noise": {"noise": "levy 1.5 1 44"},
        "half the speed": {"speed": world.speed / 2},
        "twice the speed": {"speed": world.speed * 2},
        "4 times the speed": {"speed": world.speed * 4},
        "half the tick": {"tau": world.tau / 2},
        "twice the tick": {"tau": world.tau * 2},
        "exact first estimate": {"initial_error": 0},
        "first estimate 3 times as wrong": {"initial_error": (9 * position, 9 * velocity)},
        "all filters followed": {"follow": "bank"},
    }
    if isinstance(world.scheme, RandomScheme) and world.scheme.radii is None:
        segments, (short, long) = world.scheme.segments, world.scheme.lengths
        for name, factor in (
            ("half the radii", 0.5),
            ("twice the radii", 2.0),
            ("2.4 times the radii", 2.4),
        ):
            shifts[name] = {"radii": tuple(radius * factor for radius in world.radii)}
        two = tuple(sorted({factor * radius for radius in world.radii for factor in (0.8, 1.8)}))
        shifts["two radii for each"] = {"radii": two}
        for name, factor in (
            ("half the length", 0.5),
            ("twice the length", 2.0),
        ):
            lengths = max(1, round(short * factor)), max(1, round(long * factor))
            shifts[name] = {"scheme": f"random {segments}x{lengths[0]}-{lengths[1]}"}
    return shifts


def _plain(value: Any) -> Any:
    return float(value) if np.ndim(value) == 0 else tuple(np.asarray(value).tolist())


def _log_uniform(generator: Generator, limits: tuple[float, float], beyond: float = 1.0) -> float:
    """Return a number from low / beyond to high * beyond, uniform in its logarithm."""
    low, high = limits
    return float(log_uniform(generator, low / beyond, high * beyond))


def draw_world(generator: Generator, radii_count: int, beyond: float = 1.0) -> dict[str, Any]:
    """Return options of a random world, with ranges that are wider by a factor `beyond` at both
    ends.

    Half of the worlds have the tick and the speed of HybridTrack-v0, because the published reset of
    the covariance to the identity depends on the units. In each, some properties differ from their
    usual values.
    """
    # Ticks of the shortest segment.
    drawn = round(_log_uniform(generator, (20, 100), beyond))
    shortest = drawn if generator.random() < 0.6 else 50
    longest = round(shortest * generator.uniform(1.0, 2.5))
    # Largest over smallest radius.
    spread = _log_uniform(generator, (1.5, 25.0), beyond) if radii_count > 1 else 1.0
    motion = 0.0
    turn = 0.0
    # Of the widest turn from a straight line after half a segment, over sqrt(R).
    while motion * turn / spread * (shortest + longest) ** 2 / 32.0 < 3.0:
        # Distance per tick over the deviation of a measurement.
        motion = _log_uniform(generator, (0.08, 8.0), beyond)
        # Turn angle per tick of the smallest radius [rad].
        turn = _log_uniform(generator, (0.012, 0.25), beyond)
    tau = 0.1
    deviation = 0.0
    if generator.random() < 0.5:
        deviation = 0.2 / motion
    else:
        # Units of time [s] and of length [m].
        tau = _log_uniform(generator, (0.01, 60.0))
        deviation = _log_uniform(generator, (0.03, 1000.0))
    speed = motion * deviation / tau
    smallest = speed * tau / turn
    spaced = np.linspace if generator.random() < 0.5 else np.geomspace
    radii = spaced(smallest, smallest * spread, radii_count)
    # Deviation of process noise per tick over the speed.
    noise = _log_uniform(generator, (0.003, 0.06), beyond) if generator.random() < 0.6 else 0.0158
    # Measurement variance of one axis over that of the other.
    ratio = _log_uniform(generator, (0.05, 20.0), beyond)
    axes = ratio**0.5 if generator.random() < 0.3 else 1.0
    velocity = speed * _log_uniform(generator, (0.01, 0.3))
    banks = (
        ("published", "declared"),
        ("anchor_aware", "declared"),
        ("published", "bank"),
        ("anchor_aware", "bank"),
    )
    bank, follow = banks[generator.choice(len(banks), p=(0.55, 0.2, 0.1, 0.15))]
    outliers = generator.random() < 0.35
    law = f"outliers {generator.uniform(0.0, beyond * 0.1)}" if outliers else "gaussian"
    world = {
        "scheme": f"random 6x{shortest}-{longest}",
        "radii": tuple(radii.tolist()),
        "speed": speed,
        "tau": tau,
        "process_variance": (noise * speed) ** 2,
        "measurement_variance": (deviation**2 * axes, deviation**2 / axes),
        "noise": law,
        "initial_error": (_log_uniform(generator, (0.05, 5.0)), velocity**2),
        "bank": bank,
        "follow": follow,
        "correctness": "type" if radii_count > 1 and generator.random() < 0.6 else "exact",
    }
    return world | ({"noise": _draw_heavy_tails(generator)} if generator.random() < 0.3 else {})


def _draw_heavy_tails(generator: Generator) -> str:
    """Return a law of the measurement noise with heavy tails, stable or Student's t."""
    if generator.random() < 0.7:
        index = generator.uniform(1.2, 1.9)
        scale = _log_uniform(generator, (0.5, 1.2))
        return f"levy {index:.6g} {scale:.6g} {_log_uniform(generator, (10.0, 1000.0)):.6g}"
    return f"student_t {_log_uniform(generator, (1.5, 8.0)):.6g}"


def draw_worlds(count: int, seed: int) -> dict[str, dict[str, Any]]:
    """Return name and options of random worlds with 3, 7 or 21 hypotheses, from wider ranges
    than in training.
    """
    generators = [np.random.default_rng(seed + k) for k in range(count)]
    return {
        f"random world {k}": draw_world(
            generator, int(generator.choice([1, 3, 10], p=[0.6, 0.2, 0.2])), beyond=2.0
        )
        for k, generator in enumerate(generators, start=1)
    }
