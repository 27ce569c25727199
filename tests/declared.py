"""Values that a declared type does not allow, for the contract tests of everything declared."""

import math
import types
import typing

import numpy as np
from hostile_input import refused

from hybrid_env.checks import declaration, declared_fields

OTHERS = [
    object(),
    "5" * 5000,
    b"5",
    math.nan,
    10**400,
    1j,
    [[1.0, 2.0], [3.0]],
    np.ma.masked,
    np.timedelta64(1, "s"),
]
"""Of types that no field of one number, flag or word has."""


def beyond(hint):
    """Yield values next to the limits of a declared type, and some of other types."""
    kind, limits = declaration(hint)
    inner = [part for part in typing.get_args(kind) if part is not types.NoneType]
    if typing.get_origin(kind) in (typing.Union, types.UnionType):
        if len(inner) == 1:
            yield from beyond(inner[0])
    elif kind in (int, float):
        for name, sign in (("ge", -1), ("le", 1)):
            if name in limits:
                limit = limits[name]
                yield limit + sign if kind is int else math.nextafter(limit, sign * math.inf)
        yield from (limits[name] for name in ("gt", "lt") if name in limits)
        yield True
        yield from (value for value in OTHERS if kind is float or not isinstance(value, int))
    elif kind is bool or typing.get_origin(kind) is typing.Literal:
        yield from (1, *OTHERS)
    elif kind is not str and (typing.get_origin(kind) is tuple or "parse" in limits):
        yield from (object(), 1j, [[1.0, 2.0], [3.0]], [object()])


def refuse_beyond(kind, **given):
    """Check that a dataclass refuses what its fields do not allow, in one line that names them.

    given: fields without a default.
    """
    tried = 0
    for name, hint in declared_fields(kind).items():
        for value in beyond(hint):
            assert refused(kind, **given | {name: value}).startswith(f"{name}="), (name, value)
            tried += 1
    return tried
