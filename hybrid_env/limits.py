"""Allowed ranges of the options. Inside them every observation is finite and inside the observation
space; `make study` tests this with 10^9 ticks of random options. They are so wide that neither the
object nor the units matter.
"""

from collections.abc import Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from hybrid_env.checks import ArgumentError, FloatArray, check_integer, check_number, ranged, reject

RANGES = {
    # [m]
    "radii": (1e-12, 1e12),
    # [m/s]
    "speed": (1e-9, 1e9),
    # [rad]
    "heading": (-1e6, 1e6),
    # [s]
    "tau": (1e-9, 1e9),
    # [m^2/s^2]
    "process_variance": (0.0, 1e18),
    # [m^2/s^2]
    "object_variance": (0.0, 1e18),
    # [m^2]
    "measurement_variance": (1e-18, 1e18),
    # [m]
    "range_deviation": (1e-9, 1e9),
    # [rad]
    "bearing_deviation": (1e-6, 1.0),
    # [m/s]
    "rate_deviation": (1e-9, 1e9),
    "delay_cost": (0.0, 1e6),
    "evidence": (0.0, 1.0 - 1e-9),
    # Variance / R.
    "initial_position": (0.0, 1e12),
    # Variance [m^2/s^2].
    "initial_velocity": (0.0, 1e18),
}
"""Smallest and largest value of each option."""

# Of a bank, and of a random scheme.
MAX_RADII = 1000
# Segments of a fixed scheme, which are stored.
MAX_PIECES = 10_000
# Ticks per segment, and segments of a random scheme.
MAX_LENGTH = 1_000_000

# Speed * tau / radius [rad]; from pi on a turn cannot be told from a slower one.
LARGEST_TURN = 100.0
# Motion per tick / standard deviation of a measurement.
LARGEST_MOTION = 1e9
# Radius / standard deviation of a measurement; a float64 has 16 digits.
LARGEST_CIRCLE = 1e12


def check_within(name: str, value: Any, limits: str = "") -> float:
    """Return a finite float inside a range; limits: key of `RANGES`, by default the name."""
    return float(ranged(*RANGES[limits or name])(name, value))


def check_ticks(name: str, value: Any) -> int:
    """Return an integer from 1 to `MAX_LENGTH`."""
    return check_integer(name, value, maximum=MAX_LENGTH)


def _values(value: Any) -> Sequence[Any]:
    """Return the elements of a sequence or array, or a list of a single value."""
    if isinstance(value, np.ndarray):
        # Masked elements become None.
        elements = value.tolist()
        return elements if value.ndim else [elements]
    return value if isinstance(value, Sequence) and not isinstance(value, (str, bytes)) else [value]


def two_values(name: str, value: Any, allowed: str) -> Sequence[Any]:
    """Return the two elements of a tuple, list or array."""
    values = _values(value)
    if len(values) != 2:
        raise reject(name, value, allowed)
    return values


def distinct_radii(name: str, value: Any) -> tuple[float, ...]:
    """Return distinct turn radii [m] of a number, or of a tuple, list or (n,) array of numbers."""
    values, (low, high) = _values(value), RANGES["radii"]
    with suppress(ArgumentError):
        radii = tuple(check_within(name, one, "radii") for one in values[: MAX_RADII + 1])
        if 1 <= len(values) <= MAX_RADII and len(set(radii)) == len(radii):
            return radii
    raise reject(name, value, f"1 to {MAX_RADII} distinct numbers from {low:g} to {high:g}")


def check_variances(value: Any) -> float | tuple[float, float]:
    """Return the measurement variance [m^2], one number or (x, y). Equal variances become one
    number.
    """
    name = "measurement_variance"
    values = _values(value)
    if len(values) == 1 and values is not value:
        return check_within(name, values[0])
    x, y = (check_within(name, one) for one in two_values(name, value, "one number or (x, y)"))
    return x if x == y else (x, y)


def axis_variances(value: Any) -> FloatArray:
    """Return checked measurement variances [m^2]: (1,) if x and y have the same variance, else
    (2,).
    """
    return np.atleast_1d(np.array(check_variances(value), np.float64))


def check_initial_error(name: str, value: Any) -> tuple[float, float]:
    """Return (position variance of the first estimate / R, its velocity variance [m^2/s^2])."""
    allowed = "(position variance over R, velocity variance) or 0"
    values = _values(value)
    if len(values) == 1 and values is not value:
        check_number(name, values[0], allowed, 0.0, 0.0)
        return 0.0, 0.0
    position, velocity = two_values(name, value, allowed)
    return check_within(name, position, "initial_position"), check_within(
        name,
        velocity,
        "initial_velocity",
    )
