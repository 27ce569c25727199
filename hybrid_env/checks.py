"""Checks of values against their declared types, and types of arrays. An error is one line: the
argument, its value, the allowed values.

A type is declared with the field that has it, in the words of `annotated_types`:
`Annotated[float, Interval(ge=0.0, le=1.0), Unit("s")]`. A function among them, as in
`Annotated[str | Scheme, parse_scheme]`, takes value and name, and returns the value to be stored.
"""

import copy
import dataclasses
import difflib
import functools
import inspect
import math
import operator
import reprlib
import types
import typing
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from numbers import Integral, Real
from typing import Annotated, Any, Self

import numpy as np
from annotated_types import BaseMetadata, Ge, GroupedMetadata, Gt, Interval
from numpy.typing import ArrayLike

from hybrid_env.core.arrays import AnyArray as AnyArray
from hybrid_env.core.arrays import BoolArray as BoolArray
from hybrid_env.core.arrays import Float32Array as Float32Array
from hybrid_env.core.arrays import FloatArray as FloatArray
from hybrid_env.core.arrays import IntArray as IntArray
from hybrid_env.core.errors import ArgumentError as ArgumentError
from hybrid_env.core.errors import shorten

# Means and covariances.
Moments = tuple[FloatArray, FloatArray]
# Options of `reset`, and what it and `step` tell beside the observation.
Info = dict[str, Any]
Count = Annotated[int, Ge(1)]
NotNegative = Annotated[int, Ge(0)]
Positive = Annotated[float, Gt(0.0)]
PositiveOrZero = Annotated[float, Ge(0.0)]
Share = Annotated[float, Interval(ge=0.0, lt=1.0)]
Probability = Annotated[float, Interval(gt=0.0, lt=1.0)]

# Magnitude of an element of an array; its square must not overflow.
LARGEST_NUMBER = 1e30


class KeywordError(ArgumentError, TypeError):
    """A keyword does not exist: other libraries expect the error of Python, and read its words."""


class OwnState:
    """A class whose copies share no state with it: a step, which changes arrays in place, does
    not move the others.
    """

    def __copy__(self) -> Self:
        return copy.deepcopy(self)


class Checked:
    """A dataclass whose fields are checked by their declared types when it is made, and stored as
    plain values.
    """

    def __post_init__(self) -> None:
        check_fields(self)


def reject(name: str, value: Any, allowed: str) -> ArgumentError:
    """Return the error for a value that is not allowed. The caller raises it."""
    # Does not print all of a nested or a large value.
    short = reprlib.Repr()
    short.maxstring = short.maxother = short.maxlong = 120
    short.maxlevel = 3
    shown = shorten(short.repr(value), 120)
    return ArgumentError(f"{name}={shown} is not allowed: expected {allowed}")


def unknown(name: str, value: Any, known: Iterable[str], otherwise: str = "") -> ArgumentError:
    """Return the error for a name that does not exist, with the nearest that do. The caller raises
    it.

    Args:
        name, value: of the argument.
        known: all names that exist.
        otherwise: what the message says if none is near; by default all names.
    """
    names = list(known)
    words = _nearest(value, names) or otherwise or f"expected one of {', '.join(names)}"
    return ArgumentError(f"{name}={shorten(repr(value), 120)} does not exist: {words}")


def _nearest(value: Any, names: Iterable[str]) -> str:
    """Return a question for the names near a value; empty if none is."""
    near = difflib.get_close_matches(str(value), list(names), 2)
    return f"did you mean {' or '.join(map(repr, near))}?" if near else ""


def of_keywords(kind: Any, keywords: Mapping[str, Any], further: Iterable[str] = ()) -> Any:
    """Make a dataclass of the keywords of a function, which may have further ones. A name that does
    not exist raises `KeywordError`, with the nearest ones.
    """
    names = declared_fields(kind).keys()
    for name in keywords.keys() - names:
        near = _nearest(name, [*names, *further])
        message = f"{kind.__name__}.__init__() got an unexpected keyword argument {name!r}"
        raise KeywordError(message + (near and f": {near}"))
    return kind(**keywords)


def declaration(hint: Any) -> tuple[Any, dict[str, Any]]:
    """Return the plain type of a declared one, and its limits by their names in `annotated_types`;
    "parse" is a function.
    """
    if typing.get_origin(hint) is not Annotated:
        return hint, {}
    limits: dict[str, Any] = {}
    for part in hint.__metadata__:
        if inspect.isfunction(part):
            limits["parse"] = part
        elif isinstance(part, (BaseMetadata, GroupedMetadata)):
            given: Any = dataclasses.asdict(part)  # type: ignore[call-overload]
            limits |= {name: limit for name, limit in given.items() if limit is not None}
    return hint.__origin__, limits


@functools.cache
def declared_fields(kind: type) -> dict[str, Any]:
    """Return the declared types of the fields of a dataclass."""
    hints = typing.get_type_hints(kind, include_extras=True)
    return {field.name: hints[field.name] for field in dataclasses.fields(kind)}


def check_fields(instance: Any) -> None:
    """Check the fields of a dataclass by their declared types, and store them as plain values."""
    kind: Any = type(instance)
    for name, hint in declared_fields(kind).items():
        object.__setattr__(instance, name, checked(name, getattr(instance, name), hint))


def checked(name: str, value: Any, hint: Any) -> Any:
    """Return a value as its declared type stores it, numbers and tuples of Python. Raises
    `ArgumentError` for others.
    """
    kind, limits = declaration(hint)
    origin = typing.get_origin(kind) or kind
    inner = typing.get_args(kind)
    if "parse" in limits:
        return limits["parse"](value, name)
    if origin in (typing.Union, types.UnionType):
        others = [other for other in inner if other is not types.NoneType]
        if (value is None and len(others) < len(inner)) or len(others) > 1:
            return value
        return checked(name, value, others[0])
    if origin is typing.Literal:
        if isinstance(value, str) and value in inner:
            return str(value)
    elif kind is bool:
        if isinstance(value, (bool, np.bool_)):
            return bool(value)
    elif kind in (int, float):
        number = _number(value, kind)
        bounds = limits.keys() & {"ge", "gt", "le", "lt"}
        if number is not None and all(
            getattr(operator, bound)(number, limits[bound]) for bound in bounds
        ):
            return number
    elif origin is tuple and inner:
        return _checked_elements(name, value, hint)
    elif dataclasses.is_dataclass(kind) and isinstance(value, Mapping):
        with suppress(TypeError):
            return kind(**value)  # type: ignore[operator]
    elif origin is Any or not isinstance(origin, type) or isinstance(value, origin):
        return value
    raise reject(name, value, described(hint))


def described(hint: Any) -> str:
    """Return what a declared type allows, in words."""
    kind, limits = declaration(hint)
    origin = typing.get_origin(kind) or kind
    inner = typing.get_args(kind)
    if origin is typing.Literal:
        return "one of " + ", ".join(map(repr, inner))
    if origin is tuple and inner:
        least = limits.get("min_length", 0)
        most = limits.get("max_length", "any number")
        count = f"{least} to {most}" if inner[-1] is Ellipsis else str(len(inner))
        return f"a list of {count} values, each {described(inner[0])}"
    if dataclasses.is_dataclass(kind):
        return f"a mapping with some of {', '.join(declared_fields(kind))}"  # type: ignore[arg-type]
    words = {
        bool: "True or False",
        int: "an integer",
        float: "a finite number",
        str: "a text",
        Mapping: "a mapping",
    }
    text = words.get(origin, f"an object {kind}")
    signs = {"ge": ">=", "gt": ">", "le": "<=", "lt": "<"}
    parts = [f"{sign} {limits[name]:.10g}" for name, sign in signs.items() if name in limits]
    unit = f" [{limits['unit']}]" if "unit" in limits else ""
    return f"{text} {' and '.join(parts)}{unit}".strip()


def _number(value: Any, kind: type) -> Any:
    """Return a number as int or finite float. Bools, strings, NaN, infinities and durations are
    none: None.
    """
    wanted = Integral if kind is int else Real
    if isinstance(value, (bool, np.bool_, np.timedelta64)) or not isinstance(value, wanted):
        return None
    try:
        number = kind(value)
    except (OverflowError, ValueError):
        # An integer may be too large.
        return None
    return number if kind is int or math.isfinite(number) else None


def elements(value: Any) -> Sequence[Any]:
    """Return the elements of a sequence or array, or a list of a single value."""
    if isinstance(value, np.ndarray):
        # Masked elements become None.
        return np.atleast_1d(value).tolist()
    return value if isinstance(value, Sequence) and not isinstance(value, (str, bytes)) else [value]


def _checked_elements(name: str, value: Any, hint: Any) -> tuple[Any, ...]:
    kind, limits = declaration(hint)
    inner = typing.get_args(kind)
    values = elements(value)
    several = inner[-1] is Ellipsis
    fewest = limits.get("min_length", 0) if several else len(inner)
    most = limits.get("max_length", math.inf) if several else len(inner)
    if values is value or isinstance(value, np.ndarray):
        try:
            if fewest <= len(values) <= most:
                hints = [inner[0]] * len(values) if several else inner
                parts = zip(values, hints, strict=True)
                return tuple(checked(name, element, part) for element, part in parts)
        except ArgumentError:
            # The message about a dataclass names its field.
            if dataclasses.is_dataclass(inner[0]):
                raise
    raise reject(name, value, described(hint))


def check_number(
    name: str,
    value: Any,
    allowed: str = "a finite number",
    low: float = -math.inf,
    high: float = math.inf,
) -> float:
    """Return a finite float from `low` to `high`."""
    number = _number(value, float)
    if number is None or not low <= number <= high:
        raise reject(name, value, allowed)
    return float(number)


def check_integer(name: str, value: Any, minimum: int = 1, maximum: int | None = None) -> int:
    """Return an integer >= `minimum`, and <= `maximum` unless that is None."""
    return checked(name, value, Annotated[int, Interval(ge=minimum, le=maximum)])


def check_choice(name: str, value: Any, choices: Iterable[str]) -> str:
    """Return a string that is one of `choices`."""
    return checked(name, value, typing.Literal[*choices])


def check_array(
    name: str, value: ArrayLike, shape: tuple[int | None, ...], missing: bool = False
) -> FloatArray:
    """Return a copy as a finite float64 array of a given shape; None in `shape` allows any length
    >= 1, and `missing` allows NaN.
    """
    given = as_array(value)
    # The mask would be lost.
    numeric = given.dtype.kind in "fiu" and not np.ma.is_masked(value)
    array = np.array(given if numeric else np.nan, np.float64)
    allowed = ", ".join("*" if size is None else str(size) for size in shape)
    fits = array.ndim == len(shape) and all(
        length > 0 and size in (None, length)
        for length, size in zip(array.shape, shape, strict=True)
    )
    # False for NaN.
    finite = np.abs(array) <= LARGEST_NUMBER
    if not fits or not (finite | (missing & np.isnan(array))).all():
        shape_given = "" if fits else f", not {given.shape}"
        raise reject(
            name,
            value,
            f"numbers up to {LARGEST_NUMBER:g}, none masked, of shape ({allowed}){shape_given}",
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
    valid = (
        (np.abs(correlations) <= 1.0 + 1e-9).all()
        and np.allclose(correlations, transposed, rtol=0.0, atol=1e-9)
        and np.linalg.eigvalsh(correlations).min() > (1e-15 if definite else -1e-9)
    )
    if not valid:
        kind = "positive definite" if definite else "without negative eigenvalues"
        raise reject(name, matrix.tolist(), f"symmetric matrices, {kind}")
    return 0.5 * (matrix + np.swapaxes(matrix, -1, -2))


def as_array(value: ArrayLike) -> AnyArray:
    """Return a value as an array; that of None for rows of different lengths, and for a tensor
    with a gradient.
    """
    try:
        return np.asarray(value)
    except (TypeError, ValueError, RuntimeError):
        return np.array(None)


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
