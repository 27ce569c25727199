"""The operations that the kernel needs of a bank, under one name for both banks.

`numba.extending.overload` chooses the implementation by the type of the bank when a kernel is compiled, so a
compiled kernel holds one bank only. A further bank implements these five functions with the same arguments
and gets its line in `_implementation`.
"""

import functools
from collections.abc import Callable
from typing import Any

import numpy as np
from numba.extending import overload
from numpy.typing import NDArray

from hybrid_env.core.anchor_aware_bank import (
    aware_of_block,
    begin_aware,
    covariance_aware,
    follow_aware,
    step_aware,
)
from hybrid_env.core.compilation import OPTIONS
from hybrid_env.core.published_bank import (
    PublishedBank,
    State,
    Ten,
    begin_published,
    covariance_published,
    follow_published,
    published_of_block,
    step_published,
)

# not strict: numba would compare annotations too
_overload: Any = functools.partial(overload, jit_options=OPTIONS, strict=False)


def bank_of_block(banks: Any, block: int) -> Any:
    """The bank of one block, from those of all."""
    raise NotImplementedError("compiled code only")


def begin(
    bank: Any, lane: int, anchor: State, covariance: Ten, radii: NDArray[np.float64], model: Any
) -> None:
    """Start every hypothesis of a lane at one estimate. covariance: upper triangle, row by row."""
    raise NotImplementedError("compiled code only")


def step(bank: Any, first: int, last: int, measurement: NDArray[np.float64], model: Any) -> None:
    """One tick of every hypothesis, for lanes first .. last - 1. measurement: (2, LANES) [m]."""
    raise NotImplementedError("compiled code only")


def follow(bank: Any, lane: int, hypothesis: int, measurement: NDArray[np.float64], model: Any) -> None:
    """One tick of the decided hypothesis of a lane; its log-likelihood stays."""
    raise NotImplementedError("compiled code only")


def covariance(bank: Any, hypothesis: int, lane: int) -> Ten:
    """Covariance of [x, vx, y, vy] of one hypothesis, upper triangle row by row."""
    raise NotImplementedError("compiled code only")


def _implementation(bank: Any, published: Any, aware: Any) -> Callable[..., Any]:
    """The Python function to compile for a bank of a numba type."""
    chosen: Callable[..., Any] = (published if bank.instance_class is PublishedBank else aware).py_func
    return chosen


@_overload(bank_of_block)
def _bank_of_block(banks, block):  # type: ignore[no-untyped-def]
    return _implementation(banks, published_of_block, aware_of_block)


@_overload(begin)
def _begin(bank, lane, anchor, covariance, radii, model):  # type: ignore[no-untyped-def]
    return _implementation(bank, begin_published, begin_aware)


@_overload(step)
def _step(bank, first, last, measurement, model):  # type: ignore[no-untyped-def]
    return _implementation(bank, step_published, step_aware)


@_overload(follow)
def _follow(bank, lane, hypothesis, measurement, model):  # type: ignore[no-untyped-def]
    return _implementation(bank, follow_published, follow_aware)


@_overload(covariance)
def _covariance(bank, hypothesis, lane):  # type: ignore[no-untyped-def]
    return _implementation(bank, covariance_published, covariance_aware)
