"""The environments of a distribution shift: the nominal one with one property changed."""

from typing import Any

import numpy as np

from hybrid_env.options import WorldOptions
from hybrid_env.scheme import RandomScheme

NOMINAL = "nominal"


def shifted_worlds(world: WorldOptions) -> dict[str, dict[str, Any]]:
    """Return name and changed options of the environments around the nominal one, the nominal one first."""
    R, Q = np.asarray(world.measurement_variance), world.process_variance
    position, velocity = world.initial_error if isinstance(world.initial_error, tuple) else (0.0, 0.0)
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
        for name, factor in (("half the radii", 0.5), ("twice the radii", 2.0), ("2.4 times the radii", 2.4)):
            shifts[name] = {"radii": tuple(radius * factor for radius in world.radii)}
        two = tuple(sorted({factor * radius for radius in world.radii for factor in (0.8, 1.8)}))
        shifts["two radii for each"] = {"radii": two}
        for name, factor in (("half the length", 0.5), ("twice the length", 2.0)):
            lengths = max(1, round(short * factor)), max(1, round(long * factor))
            shifts[name] = {"scheme": f"random {segments}x{lengths[0]}-{lengths[1]}"}
    return shifts


def _plain(value: Any) -> Any:
    return float(value) if np.ndim(value) == 0 else tuple(np.asarray(value).tolist())
