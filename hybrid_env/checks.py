"""Argument checks. Every error is one line with the argument, its value and the allowed values."""

import math
from collections.abc import Iterable
from numbers import Integral, Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray


class ArgumentError(ValueError):
    """An argument has a value that is not allowed. The message is a single line."""


def reject(name: str, value: Any, allowed: str) -> ArgumentError:
    """Return the error for a value that is not allowed. The caller raises it."""
    shown = repr(value.item() if isinstance(value, np.generic) else value)
    if len(shown) > 120:
        shown = f"{shown[:58]}...{shown[-58:]}"
    return ArgumentError(f"{name}={shown} is not allowed: expected {allowed}")


def check_number(name: str, value: Any, allowed: str = "a finite number") -> float:
    """Return a finite float. Raises `ArgumentError` for bools, strings, NaN and infinities."""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, Real) or not math.isfinite(value):
        raise reject(name, value, allowed)
    return float(value)


def check_positive(name: str, value: Any, allow_zero: bool = False) -> float:
    """Return a finite float > 0, or >= 0 with `allow_zero`."""
    allowed = "a finite number >= 0" if allow_zero else "a finite number > 0"
    number = check_number(name, value, allowed)
    if number < 0.0 or (number == 0.0 and not allow_zero):
        raise reject(name, value, allowed)
    return number


def check_between(name: str, value: Any, low: float, high: float) -> float:
    """Return a float strictly between two bounds."""
    allowed = f"a number strictly between {low:g} and {high:g}"
    number = check_number(name, value, allowed)
    if not low < number < high:
        raise reject(name, value, allowed)
    return number


def check_integer(name: str, value: Any, minimum: int = 1) -> int:
    """Return an integer >= `minimum`."""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, Integral) or value < minimum:
        raise reject(name, value, f"an integer >= {minimum}")
    return int(value)


def check_choice(name: str, value: Any, choices: Iterable[str]) -> str:
    """Return a string that is one of `choices`."""
    choices = tuple(choices)
    if not isinstance(value, str) or value not in choices:
        raise reject(name, value, "one of " + ", ".join(map(repr, choices)))
    return value


def check_flag(name: str, value: Any) -> bool:
    """Return a bool. Raises `ArgumentError` for other truthy or falsy values."""
    if not isinstance(value, (bool, np.bool_)):
        raise reject(name, value, "True or False")
    return bool(value)


def check_array(name: str, value: ArrayLike, shape: tuple[int | None, ...]) -> NDArray[np.float64]:
    """Return a copy as a finite float64 array of a given shape; None in `shape` allows any length >= 1."""
    expected = (
        "("
        + ", ".join("*" if size is None else str(size) for size in shape)
        + ("," * (len(shape) == 1))
        + ")"
    )
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise reject(name, value, f"an array of finite numbers of shape {expected}") from None
    if array.ndim != len(shape) or any(
        length == 0 or (size is not None and length != size)
        for length, size in zip(array.shape, shape, strict=True)
    ):
        raise ArgumentError(f"{name} has shape {array.shape}: expected {expected}, no dimension of length 0")
    bad = np.argwhere(~np.isfinite(array))
    if bad.size:
        index = tuple(int(i) for i in bad[0])
        raise ArgumentError(
            f"{name}[{', '.join(map(str, index))}]={array[index]} is not allowed: expected finite numbers"
        )
    return array


def check_radii(name: str, value: ArrayLike) -> NDArray[np.float64]:
    """Return (n,) distinct turn radii > 0 [m]."""
    allowed = "one or more distinct finite radii > 0"
    try:
        radii = np.atleast_1d(np.array(value, dtype=np.float64))
    except (TypeError, ValueError):
        raise reject(name, value, allowed) from None
    if (
        radii.ndim != 1
        or radii.size == 0
        or not np.isfinite(radii).all()
        or (radii <= 0).any()
        or np.unique(radii).size != radii.size
    ):
        raise reject(name, value, allowed)
    return radii


def axis_variances(measurement_variance: float | ArrayLike) -> NDArray[np.float64]:
    """Return the measurement variances [m^2]: (1,) if x and y have the same variance, else (2,)."""
    values = np.atleast_1d(np.asarray(measurement_variance))
    if values.size == 1:
        return np.array([check_positive("measurement_variance", values.item())])
    pair = check_array("measurement_variance", measurement_variance, (2,))
    for value in pair:
        check_positive("measurement_variance", value)
    return pair[:1].copy() if pair[0] == pair[1] else pair
