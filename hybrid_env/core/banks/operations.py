"""The operations of a bank that the kernel calls, selected by the type of the bank when a kernel is compiled.

A compiled kernel therefore contains a single bank. numba has no public name for the class of a named tuple in
compiled code: `instance_class`, an attribute of its type, is used here and nowhere else.

    bank_of_block(banks, block)                          the bank of one block
    begin(bank, lane, anchor, covariance, radii, model)  start every filter of a lane from the anchor
    step(bank, first, last, measurement, model)          advance every filter of lanes first .. last - 1
    follow(bank, lane, hypothesis, measurement, model)   advance one filter, without its log-likelihood
    predict(bank, lane, model)                           advance every filter of a lane without a measurement
    covariance(bank, hypothesis, lane)                   of [x, vx, y, vy], upper triangle row by row

The arguments are described in `published`. Calls with the same types of indices and of the model share one
compiled function: the kernel gives unsigned indices, which need no check for negative values, so that loops
over lanes become SIMD code, and a `FilterModel`. A new bank implements these functions and is listed in
`OPERATIONS`, `state.BANKS` and `kernels.KERNELS`.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numba.extending import overload

from hybrid_env.core.banks.anchor_aware import (
    AnchorAwareBank,
    aware_of_block,
    begin_aware,
    covariance_aware,
    follow_aware,
    predict_aware,
    step_aware,
)
from hybrid_env.core.banks.bank import FilterModel
from hybrid_env.core.banks.published import (
    PublishedBank,
    begin_published,
    covariance_published,
    follow_published,
    predict_published,
    published_of_block,
    step_published,
)
from hybrid_env.core.compilation import CALLEE_OPTIONS, inlined, internal

OPERATIONS: dict[type, tuple[Callable[..., Any], ...]] = {
    PublishedBank: (
        published_of_block, begin_published, step_published, follow_published, predict_published,
        covariance_published,
    ),
    AnchorAwareBank: (
        aware_of_block, begin_aware, step_aware, follow_aware, predict_aware, covariance_aware,
    ),
}  # fmt: skip
"""The functions that are compiled for each bank, in the order above."""


def _operation(number: int) -> Any:
    """Return an operation for compiled code."""

    def operation(bank: Any, *arguments: Any) -> Any:
        raise NotImplementedError("compiled code only")

    # not strict: the names of the arguments may differ
    @overload(operation, jit_options=CALLEE_OPTIONS, strict=False)
    def select(bank, *arguments):  # type: ignore[no-untyped-def]
        return OPERATIONS[bank.instance_class][number]

    return operation


bank_of_block, begin, step, follow, predict, covariance = map(_operation, range(6))


@inlined
def filter_model(setting: Any, ratio: float) -> FilterModel:
    """Return the model of the filters for a measurement whose variance over R is `ratio`."""
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
            predict(bank, np.uint64(lane), filter_model(setting, 1.0))
        else:
            model = filter_model(setting, block.variance_ratio[lane])
            step(bank, np.uint64(lane), np.uint64(lane + 1), block.measurement, model)


@internal
def follow_irregular(bank: Any, lane: int, hypothesis: int, block: Any, setting: Any) -> None:
    """Advance the filter of one hypothesis; see `step_irregular`. Without a measurement all are predicted."""
    if math.isnan(block.measurement[0, lane]):
        predict(bank, np.uint64(lane), filter_model(setting, 1.0))
    else:
        model = filter_model(setting, block.variance_ratio[lane])
        follow(bank, lane, hypothesis, block.measurement, model)
