"""Declared types of the quantities of the model. They are so wide that neither the object nor the
units matter; inside them every observation is finite and inside the observation space, which `make
study` tests with 10^9 ticks of random options.
"""

from typing import Annotated, Any, TypeAlias

import numpy as np
from annotated_types import Interval, Len, Unit

from hybrid_env.checks import FloatArray, checked, elements, reject

# Ticks per segment, and segments of a random scheme.
MAX_LENGTH = 1_000_000

Ticks: TypeAlias = Annotated[int, Interval(ge=1, le=MAX_LENGTH)]
# Numbers of any unit.
Quantity: TypeAlias = Annotated[float, Interval(ge=1e-18, le=1e18)]
QuantityOrZero: TypeAlias = Annotated[float, Interval(ge=0.0, le=1e18)]


def distinct_radii(value: Any, name: str = "radii") -> tuple[float, ...]:
    """Return distinct turn radii [m] of a number, or of a tuple, list or (n,) array of numbers."""
    radius = Annotated[Quantity, Unit("m")]
    radii = checked(name, elements(value), Annotated[tuple[radius, ...], Len(1, 1000)])
    if len(set(radii)) < len(radii):
        raise reject(name, value, "distinct numbers")
    return tuple(radii)


def check_variances(value: Any, name: str = "measurement_variance") -> float | tuple[float, float]:
    """Return the measurement variance [m^2], one number or (x, y). Equal variances become one
    number.
    """
    values = elements(value)
    if values is not value and len(values) == 1:
        return float(checked(name, values[0], Quantity))
    x, y = checked(name, value, tuple[Quantity, Quantity])
    return x if x == y else (x, y)


def axis_variances(value: Any) -> FloatArray:
    """Return checked measurement variances [m^2]: (1,) if x and y have the same variance, else
    (2,).
    """
    return np.atleast_1d(np.array(check_variances(value), float))


def check_initial_error(value: Any, name: str = "initial_error") -> tuple[float, float]:
    """Return (position variance of the first estimate / R, its velocity variance [m^2/s^2]); 0 is
    (0, 0).
    """
    values = elements(value)
    x, y = checked(name, [0, 0] if values == [0] else values, tuple[QuantityOrZero, QuantityOrZero])
    return x, y


def check_variance_range(value: Any, name: str = "object_variance") -> float | tuple[float, float]:
    """Return a number of at least 0, or two numbers above 0, the smaller one first. Equal numbers
    become one.
    """
    values = elements(value)
    if values is not value and len(values) == 1:
        return float(checked(name, values[0], QuantityOrZero))
    smallest, largest = checked(name, value, tuple[Quantity, Quantity])
    if smallest > largest:
        raise reject(name, value, "(smallest, largest)")
    return smallest if smallest == largest else (smallest, largest)
