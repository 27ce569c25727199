"""The operations of a bank that the kernel calls, with a common interface for both banks.

`numba.extending.overload` selects the implementation by the type of the bank when a kernel is compiled, so
that a compiled kernel contains a single bank. A new bank implements these five functions with the same
arguments and is listed in `OPERATIONS` and in `kernels.BANKS` and `kernels.KERNELS`.
"""

import functools
from collections.abc import Callable
from typing import Any

import numpy as np
from numba.extending import overload
from numpy.typing import NDArray

from hybrid_env.core.anchor_aware_bank import (
    AnchorAwareBank,
    aware_of_block,
    begin_aware,
    covariance_aware,
    follow_aware,
    step_aware,
)
from hybrid_env.core.compilation import CALLEE_OPTIONS
from hybrid_env.core.published_bank import (
    PublishedBank,
    State,
    Triangle4,
    begin_published,
    covariance_published,
    follow_published,
    published_of_block,
    step_published,
)

# not strict: numba would also compare annotations
_overload: Any = functools.partial(overload, jit_options=CALLEE_OPTIONS, strict=False)


def bank_of_block(banks: Any, block: int) -> Any:
    """Return the bank of one block from the banks of all blocks."""
    raise NotImplementedError("compiled code only")


def begin(
    bank: Any, lane: int, anchor: State, covariance: Triangle4, radii: NDArray[np.float64], model: Any
) -> None:
    """Start every filter of a lane from the anchor [x, vx, y, vy]. See `published_bank.begin_published`."""
    raise NotImplementedError("compiled code only")


def step(bank: Any, first: Any, last: Any, measurement: NDArray[np.float64], model: Any) -> None:
    """Advance every filter of the lanes first .. last - 1 (integers). measurement: (2, LANES) [m]."""
    raise NotImplementedError("compiled code only")


def follow(bank: Any, lane: int, hypothesis: int, measurement: NDArray[np.float64], model: Any) -> None:
    """Advance the filter of one hypothesis of a lane by one tick, without its log-likelihood."""
    raise NotImplementedError("compiled code only")


def covariance(bank: Any, hypothesis: int, lane: int) -> Triangle4:
    """Return the covariance of [x, vx, y, vy] of one hypothesis, upper triangle row by row."""
    raise NotImplementedError("compiled code only")


OPERATIONS: dict[type, dict[Callable[..., Any], Callable[..., Any]]] = {
    PublishedBank: {
        bank_of_block: published_of_block,
        begin: begin_published,
        step: step_published,
        follow: follow_published,
        covariance: covariance_published,
    },
    AnchorAwareBank: {
        bank_of_block: aware_of_block,
        begin: begin_aware,
        step: step_aware,
        follow: follow_aware,
        covariance: covariance_aware,
    },
}
"""The function that is compiled for each operation of each bank."""


@_overload(bank_of_block)
def _bank_of_block(banks, block):  # type: ignore[no-untyped-def]
    return OPERATIONS[banks.instance_class][bank_of_block]


@_overload(begin)
def _begin(bank, lane, anchor, covariance, radii, model):  # type: ignore[no-untyped-def]
    return OPERATIONS[bank.instance_class][begin]


@_overload(step)
def _step(bank, first, last, measurement, model):  # type: ignore[no-untyped-def]
    return OPERATIONS[bank.instance_class][step]


@_overload(follow)
def _follow(bank, lane, hypothesis, measurement, model):  # type: ignore[no-untyped-def]
    return OPERATIONS[bank.instance_class][follow]


@_overload(covariance)
def _covariance(bank, hypothesis, lane):  # type: ignore[no-untyped-def]
    return OPERATIONS[bank.instance_class][covariance]
