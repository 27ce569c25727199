"""Random environments: objects, sensors and banks of many kinds, without units."""

from typing import Any

import numpy as np
from numpy.random import Generator


def log_uniform(generator: Generator, low: float, high: float, count: int | None = None) -> Any:
    """Return a number, or (count,) numbers, between two positive bounds, uniform in their
    logarithm.
    """
    return np.exp(generator.uniform(np.log(low), np.log(high), count))


def draw_world(generator: Generator, radii_count: int, beyond: float = 1.0) -> dict[str, Any]:
    """Return options of a random world, with ranges that are wider by a factor `beyond` at both
    ends.

    Half of the worlds have the tick and the speed of HybridTrack-v0, because the published reset of
    the covariance to the identity depends on the units. In each, some properties differ from their
    usual values.
    """

    def between(low: float, high: float, widened: float = beyond) -> float:
        """Return a number from low / widened to high * widened, uniform in its logarithm."""
        return float(log_uniform(generator, low / widened, high * widened))

    # Ticks of the shortest segment.
    drawn = round(between(20, 100))
    shortest = drawn if generator.random() < 0.6 else 50
    longest = round(shortest * generator.uniform(1.0, 2.5))
    # Largest over smallest radius.
    spread = between(1.5, 25.0) if radii_count > 1 else 1.0
    motion = 0.0
    turn = 0.0
    # The distance of the widest turn from a straight line after half a segment, over sqrt(R).
    while motion * turn / spread * (shortest + longest) ** 2 / 32.0 < 3.0:
        # Distance per tick over the deviation of a measurement.
        motion = between(0.08, 8.0)
        # Turn angle per tick of the smallest radius [rad].
        turn = between(0.012, 0.25)
    tau = 0.1
    deviation = 0.0
    if generator.random() < 0.5:
        deviation = 0.2 / motion
    else:
        # Units of time [s] and of length [m].
        tau = between(0.01, 60.0, 1.0)
        deviation = between(0.03, 1000.0, 1.0)
    speed = motion * deviation / tau
    smallest = speed * tau / turn
    spaced = np.linspace if generator.random() < 0.5 else np.geomspace
    radii = spaced(smallest, smallest * spread, radii_count)
    # Deviation of process noise per tick over the speed.
    noise = between(0.003, 0.06) if generator.random() < 0.6 else 0.0158
    # Measurement variance of one axis over that of the other.
    ratio = between(0.05, 20.0)
    axes = ratio**0.5 if generator.random() < 0.3 else 1.0
    velocity = speed * between(0.01, 0.3, 1.0)
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
        "initial_error": (between(0.05, 5.0, 1.0), velocity**2),
        "bank": bank,
        "follow": follow,
        "correctness": "type" if radii_count > 1 and generator.random() < 0.6 else "exact",
    }
    return world | ({"noise": _draw_heavy_tails(generator)} if generator.random() < 0.3 else {})


def _draw_heavy_tails(generator: Generator) -> str:
    """Return a law of the measurement noise with heavy tails, stable or Student's t."""
    if generator.random() < 0.7:
        index = generator.uniform(1.2, 1.9)
        scale = log_uniform(generator, 0.5, 1.2)
        return f"levy {index:.6g} {scale:.6g} {log_uniform(generator, 10.0, 1000.0):.6g}"
    return f"student_t {log_uniform(generator, 1.5, 8.0):.6g}"
