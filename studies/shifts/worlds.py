"""Environments other than the nominal one: with one property changed, and random ones."""

from typing import Any

import numpy as np

from hybrid_env import RandomScheme
from studies.shipped.random_worlds import draw_world

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
        )
    },
    **{
        law: {"durations": law, "hazard": 1.0 / mean}
        for law, mean in {
            "straight uniform 90-100, turns uniform 40-44": 68.5,
            "straight 25 + geometric 50, turns uniform 50-54": 63.5,
        }.items()
    },
    "nominal, cycle": {"transitions": "cycle", "hazard": 1.0 / 75.0},
    "uniform 55-60, habits": {
        "durations": "uniform 55-60",
        "transitions": "0 0.9 0.1, 0.2 0 0.8, 1 0 0",
        "hazard": 1.0 / 57.5,
    },
}
"""Habits of an object whose switches are unknown. The bank is told the mean duration and nothing of
the order, and the adaptive beam has none of these laws in its prior.
"""


def shifted_worlds(world: Any) -> dict[str, dict[str, Any]]:
    """Return name and changed options of the environments around the nominal one, the nominal
    one first: with one property changed, or with habits of an object whose switches are unknown.
    """
    if world.switches == "unknown":
        # As one of the transition matrices.
        three = world.hypotheses == 3
        return {
            name: habits for name, habits in RHYTHMS.items() if three or "transitions" not in habits
        }
    x, y = np.broadcast_to(world.variances, 2).tolist()
    mean = (x * y) ** 0.5
    Q = world.process_variance
    error = world.initial_error
    position, velocity = error if isinstance(error, tuple) else (0.0, 0.0)
    shifts: dict[str, dict[str, Any]] = {
        NOMINAL: {},
        "R / 100": {"measurement_variance": (x / 100, y / 100)},
        "R / 10": {"measurement_variance": (x / 10, y / 10)},
        "R x 10": {"measurement_variance": (x * 10, y * 10)},
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
        factors = {"half the radii": 0.5, "twice the radii": 2.0, "2.4 times the radii": 2.4}
        for name, factor in factors.items():
            shifts[name] = {"radii": tuple(radius * factor for radius in world.radii)}
        two = tuple(sorted({factor * radius for radius in world.radii for factor in (0.8, 1.8)}))
        shifts["two radii for each"] = {"radii": two}
        for name, factor in {"half the length": 0.5, "twice the length": 2.0}.items():
            lengths = max(1, round(short * factor)), max(1, round(long * factor))
            shifts[name] = {"scheme": f"random {segments}x{lengths[0]}-{lengths[1]}"}
    return shifts


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
