"""The operations of a bank that the kernel calls, with a common interface for both banks.

`numba.extending.overload` selects the implementation by the type of the bank when a kernel is compiled, so
that a compiled kernel contains a single bank. A new bank implements these six functions with the same
arguments and is listed in `OPERATIONS` and in `kernels.BANKS` and `kernels.KERNELS`.
"""

import functools
import math
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
from hybrid_env.core.compilation import CALLEE_OPTIONS, inlined, internal
from hybrid_env.core.irregular_ticks import predict_aware, predict_published
from hybrid_env.core.published_bank import (
    FilterModel,
    PublishedBank,
    State,
    Triangle4,
    begin_published,
    covariance_published,
    follow_published,
    published_of_block,
    step_published,
)
from hybrid_env.core.student_bank import StudentBank, follow_student, step_student, student_of_block

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


def predict(bank: Any, lane: int, model: Any) -> None:
    """Advance every filter of a lane by one tick without a measurement. Its innovations are zero."""
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
        predict: predict_published,
        covariance: covariance_published,
    },
    StudentBank: {
        bank_of_block: student_of_block,
        begin: begin_published,
        step: step_student,
        follow: follow_student,
        predict: predict_published,
        covariance: covariance_published,
    },
    AnchorAwareBank: {
        bank_of_block: aware_of_block,
        begin: begin_aware,
        step: step_aware,
        follow: follow_aware,
        predict: predict_aware,
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


@_overload(predict)
def _predict(bank, lane, model):  # type: ignore[no-untyped-def]
    return OPERATIONS[bank.instance_class][predict]


@_overload(covariance)
def _covariance(bank, hypothesis, lane):  # type: ignore[no-untyped-def]
    return OPERATIONS[bank.instance_class][covariance]


@inlined
def _model_of_tick(block: Any, lane: int, setting: Any) -> FilterModel:
    """Return the model with the variance of the measurement of a lane."""
    ratio = block.variance_ratio[lane]
    return FilterModel(
        setting.tau, setting.process_variance, ratio * setting.variance_x, ratio * setting.variance_y,
        setting.freedom,
    )  # fmt: skip


@internal
def step_irregular(bank: Any, first: Any, last: Any, block: Any, setting: Any) -> None:
    """Advance every filter where measurements may be missing or of different variances, lane by lane.

    Args:
        bank: bank of the block.
        first, last: range of lanes, first .. last - 1.
        block: a record with `measurement`, (2, LANES) [m], NaN where it is missing, and `variance_ratio`,
            (LANES,), of the measurement over R.
        setting: a record with the fields of `FilterModel`.
    """
    for lane in range(first, last):
        if math.isnan(block.measurement[0, lane]):
            predict(bank, lane, setting)
        else:
            step(bank, lane, lane + 1, block.measurement, _model_of_tick(block, lane, setting))


@internal
def follow_irregular(bank: Any, lane: int, hypothesis: int, block: Any, setting: Any) -> None:
    """Advance the filter of one hypothesis; see `step_irregular`. Without a measurement all are predicted."""
    if math.isnan(block.measurement[0, lane]):
        predict(bank, lane, setting)
    else:
        follow(bank, lane, hypothesis, block.measurement, _model_of_tick(block, lane, setting))
