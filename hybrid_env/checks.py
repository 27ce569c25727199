"""Argument checks, and types of arrays. An error is one line: the argument, its value, the
allowed values.
"""

import copy
import functools
import math
import reprlib
from collections.abc import Callable, Iterable, Mapping
from numbers import Integral, Real
from typing import Any, ClassVar, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
AnyArray = TypeVar("AnyArray", bound=NDArray[Any])
Check = Callable[[str, Any], Any]
"""Takes name and value of an argument, and returns the value as it is stored; others raise
`ArgumentError`.
"""

# Characters of a value in a message.
LONGEST_VALUE = 120
# Characters.
LONGEST_MESSAGE = 300
# Magnitude of an element of an array; its square must not overflow.
LARGEST_NUMBER = 1e30

# Does not print all of a nested or a large value.
_short = reprlib.Repr()
_short.maxstring = _short.maxother = _short.maxlong = LONGEST_VALUE
_short.maxlevel = 3


class ArgumentError(ValueError):
    """An argument has a value that is not allowed: the error of all classes and functions. The
    message is one line.
    """

    def __init__(self, message: str):
        super().__init__(_shorten(" ".join(message.split()), LONGEST_MESSAGE))


class OwnState:
    """A class whose copies share no state with it: a step, which changes arrays in place, does
    not move the others.
    """

    def __copy__(self) -> Self:
        return copy.deepcopy(self)


class ReadOnlyAttributes(OwnState):
    """A class whose attributes named in `read_only` are set once, because compiled code relies
    on them.
    """

    read_only: ClassVar[frozenset[str]] = frozenset()

    def __setattr__(self, name: str, value: Any) -> None:
        # Reading __dict__ would slow down all attributes.
        if name in self.read_only and hasattr(self, name):
            raise AttributeError(f"{type(self).__name__}.{name} is read-only")
        super().__setattr__(name, value)


class Checked:
    """A frozen dataclass whose fields are checked when it is made, in the order of `checks`."""

    checks: ClassVar[Mapping[str, Check]] = {}

    def __post_init__(self) -> None:
        for name, check in self.checks.items():
            object.__setattr__(self, name, check(name, getattr(self, name)))


def _shorten(text: str, longest: int) -> str:
    """Replace the middle of a long text by dots."""
    if len(text) <= longest:
        return text
    part = (longest - 3) // 2
    return f"{text[:part]}...{text[-part:]}"


def reject(name: str, value: Any, allowed: str) -> ArgumentError:
    """Return the error for a value that is not allowed. The caller raises it."""
    try:
        shown = _short.repr(value.item() if isinstance(value, np.generic) else value)
    except Exception:
        # Of the value's own __repr__, or an integer with too many digits.
        shown = f"<{type(value).__name__}>"
    return ArgumentError(
        f"{name}={_shorten(shown, LONGEST_VALUE)} is not allowed: expected {allowed}"
    )


def check_number(
    name: str,
    value: Any,
    allowed: str = "a finite number",
    low: float = -math.inf,
    high: float = math.inf,
) -> float:
    """Return a finite float from `low` to `high`. Bools, strings, NaN, infinities and durations
    are none.
    """
    if isinstance(value, (bool, np.bool_, np.timedelta64)) or not isinstance(value, Real):
        raise reject(name, value, allowed)
    try:
        number = float(value)
    except (OverflowError, ValueError):
        # An integer may be too large.
        raise reject(name, value, allowed) from None
    if not math.isfinite(number) or not low <= number <= high:
        raise reject(name, value, allowed)
    return number


def ranged(low: float, high: float, allowed: str = "") -> Check:
    """Return the check of a number from `low` to `high`."""
    return functools.partial(
        check_number,
        allowed=allowed or f"a number from {low:g} to {high:g}",
        low=low,
        high=high,
    )


def optional(check: Check) -> Check:
    """Return a check that also allows None."""
    return lambda name, value: None if value is None else check(name, value)


check_share = ranged(0.0, math.nextafter(1.0, 0.0), "a number >= 0 and < 1")


def check_positive(name: str, value: Any, allow_zero: bool = False) -> float:
    """Return a finite float > 0, or >= 0 with `allow_zero`."""
    low, sign = (0.0, ">=") if allow_zero else (math.ulp(0.0), ">")
    return check_number(name, value, f"a finite number {sign} 0", low)


def check_between(name: str, value: Any, low: float, high: float) -> float:
    """Return a float strictly between two bounds."""
    allowed = f"a number strictly between {low:g} and {high:g}"
    return check_number(name, value, allowed, math.nextafter(low, high), math.nextafter(high, low))


def check_integer(name: str, value: Any, minimum: int = 1, maximum: int | None = None) -> int:
    """Return an integer >= `minimum`, and <= `maximum` unless that is None."""
    allowed = (
        f"an integer >= {minimum}" if maximum is None else f"an integer from {minimum} to {maximum}"
    )
    if isinstance(value, (bool, np.bool_, np.timedelta64)) or not isinstance(value, Integral):
        raise reject(name, value, allowed)
    number = int(value)
    if number < minimum or (maximum is not None and number > maximum):
        raise reject(name, value, allowed)
    return number


def check_choice(name: str, value: Any, choices: Iterable[str]) -> str:
    """Return a string that is one of `choices`."""
    choices = tuple(choices)
    if not isinstance(value, str) or value not in choices:
        raise reject(name, value, "one of " + ", ".join(map(repr, choices)))
    return str(value)


def check_reset_options(options: Any) -> None:
    """Raise `ArgumentError` if the options of `reset` are neither a dict nor None."""
    if options is not None and not isinstance(options, dict):
        raise reject("options", options, "a dict or None")


def check_flag(name: str, value: Any) -> bool:
    """Return a bool. Raises `ArgumentError` for other truthy or falsy values."""
    if not isinstance(value, (bool, np.bool_)):
        raise reject(name, value, "True or False")
    return bool(value)


def _real_array(value: ArrayLike) -> FloatArray | None:
    """Return a copy as a float64 array, None if not every element is a real number."""
    # The mask would be lost.
    if np.ma.is_masked(value):
        return None
    try:
        array = np.asarray(value)
        if array.dtype.kind == "O" and not all(
            isinstance(item, Real) and not isinstance(item, (bool, np.bool_)) for item in array.flat
        ):
            return None
        return np.array(array, dtype=np.float64) if array.dtype.kind in "fiuO" else None
    except (TypeError, ValueError, OverflowError, MemoryError, RuntimeError):
        # Also tensors with gradients.
        return None


def check_array(
    name: str,
    value: ArrayLike,
    shape: tuple[int | None, ...],
    missing: bool = False,
) -> FloatArray:
    """Return a copy as a finite float64 array of a given shape; None in `shape` allows any length
    >= 1, and `missing` allows NaN.
    """
    expected = (
        "("
        + ", ".join("*" if size is None else str(size) for size in shape)
        + ("," * (len(shape) == 1))
        + ")"
    )
    array = _real_array(value)
    if array is None:
        raise reject(name, value, f"an array of finite numbers of shape {expected}, none masked")
    if array.ndim != len(shape) or any(
        length == 0 or (size is not None and length != size)
        for length, size in zip(array.shape, shape, strict=True)
    ):
        raise ArgumentError(
            f"{name} has shape {array.shape}: expected {expected}, no dimension of length 0"
        )
    # False for NaN.
    finite = np.abs(array) <= LARGEST_NUMBER
    bad = np.argwhere(~(finite | np.isnan(array)) if missing else ~finite)
    if bad.size:
        index = tuple(int(i) for i in bad[0])
        raise ArgumentError(
            f"{name}[{', '.join(map(str, index))}]={array[index]} is not allowed: "
            f"expected finite numbers up to {LARGEST_NUMBER:g}"
        )
    return array


def check_covariance(name: str, matrix: FloatArray, definite: bool = True) -> FloatArray:
    """Return symmetric matrices (..., n, n) without negative eigenvalues, and with none 0 if
    `definite`.
    """
    deviations = np.sqrt(np.diagonal(matrix, axis1=-2, axis2=-1).clip(0.0))
    deviations = np.where(deviations > 0.0, deviations, 1.0)
    with np.errstate(over="ignore"):
        # Units of the values do not matter.
        correlations = matrix / deviations[..., None] / deviations[..., None, :]
    transposed = np.swapaxes(correlations, -1, -2)
    bounded = (np.abs(correlations) <= 1.0 + 1e-9).all()
    symmetric = bounded and np.allclose(correlations, transposed, rtol=0.0, atol=1e-9)
    smallest = np.linalg.eigvalsh(correlations).min() if symmetric else -np.inf
    if smallest < -1e-9 or (definite and smallest <= 1e-15):
        kind = "positive definite" if definite else "without negative eigenvalues"
        raise reject(name, matrix.tolist(), f"symmetric matrices, {kind}")
    return 0.5 * (matrix + np.swapaxes(matrix, -1, -2))


def dimensions(value: ArrayLike) -> int:
    """Return the number of dimensions of an array, -1 if the value is not an array."""
    try:
        return np.ndim(value)
    except (TypeError, ValueError, RuntimeError):
        # Rows of different lengths.
        return -1


def frozen(array: AnyArray) -> AnyArray:
    """Return the array, which can no longer be changed in place."""
    array.setflags(write=False)
    return array
