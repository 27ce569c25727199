"""The operations of a bank that the kernel calls, selected by the type of the bank when a kernel
is compiled.

    bank_of_block(banks, block)                          the bank of one block
    begin(bank, lane, anchor, covariance, radii, model)  start all filters of a lane from the anchor
    step(bank, first, last, measurement, model)          advance all filters of several lanes
    follow(bank, lane, hypothesis, measurement, model)   advance one filter, not its likelihood
    predict(bank, lane, model)                           advance all filters, no measurement
    covariance(bank, hypothesis, lane)                   of [x, vx, y, vy], upper triangle by rows
    correct(bank, lane, hypothesis, block, sensors, model)  correct a predicted filter, with a radar
    predicted_position(bank, hypothesis, lane, model)    of one filter, with its covariance

Calls with the same types share one compiled function: the kernel gives unsigned indices and a
`FilterModel`. numba has no public name for the class of a named tuple in compiled code:
`instance_class` of its type is used here alone.
"""

from collections.abc import Callable
from typing import Any

from numba.extending import overload

from hybrid_env.core.banks import anchor_aware as aware
from hybrid_env.core.banks import published
from hybrid_env.core.compilation import OPTIONS

OPERATIONS: dict[type, tuple[Callable[..., Any], ...]] = {
    published.PublishedBank: (
        published.published_of_block,
        published.begin_published,
        published.step_published,
        published.follow_published,
        published.predict_published,
        published.covariance_published,
        published.correct_published,
        published.predicted_position_published,
    ),
    aware.AnchorAwareBank: (
        aware.aware_of_block,
        aware.begin_aware,
        aware.step_aware,
        aware.follow_aware,
        aware.predict_aware,
        aware.covariance_aware,
        aware.correct_aware,
        aware.predicted_position_aware,
    ),
}
"""The functions that are compiled for each bank, in the order above."""


def _operation(number: int) -> Any:
    """Return an operation for compiled code."""

    def operation(bank: Any, *arguments: Any) -> Any:
        raise NotImplementedError("compiled code only")

    # Not strict: the names of the arguments may differ.
    @overload(operation, jit_options=OPTIONS, strict=False)
    def select(bank, *arguments):  # type: ignore[no-untyped-def]
        return OPERATIONS[bank.instance_class][number]

    return operation


bank_of_block, begin, step, follow, predict, covariance, correct, predicted_position = map(
    _operation,
    range(8),
)
