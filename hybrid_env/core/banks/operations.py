"""The operations of the banks for announced switches, selected by the type of the bank when a
kernel is compiled: each is the function of this name in the file of the bank.

    of_block(banks, block)                               the bank of one block
    begin(bank, lane, anchor, covariance, radii, model)  start all filters of a lane from the anchor
    step(bank, first, last, measurement, model)          advance all filters of several lanes
    follow(bank, lane, hypothesis, measurement, model)   advance one filter, not its likelihood
    sense(bank, lane, first, last, block, sensors, model)  advance several filters of a lane without
                                                         a measurement, or by those of sensors
    covariance(bank, hypothesis, lane)                   of [x, vx, y, vy], upper triangle by rows
    predicted_position(bank, hypothesis, lane, model)    of one filter, with its covariance

Calls with the same types share one compiled function: the kernel gives unsigned indices and a
`FilterModel`. numba has no public name for the class of a named tuple in compiled code:
`instance_class` of its type is used here alone.
"""

from typing import Any

from numba.extending import overload

from hybrid_env.core.banks import anchor_aware, published
from hybrid_env.core.compilation import OPTIONS


def _operation(name: str) -> Any:
    """Return an operation for compiled code."""

    def operation(bank: Any, *arguments: Any) -> Any:
        raise NotImplementedError("compiled code only")

    # Not strict: the names of the arguments may differ.
    @overload(operation, jit_options=OPTIONS, strict=False)
    def select(bank, *arguments):  # type: ignore[no-untyped-def]
        files = {published.PublishedBank: published, anchor_aware.AnchorAwareBank: anchor_aware}
        return getattr(files[bank.instance_class], name)

    return operation


of_block, begin, step, follow, sense, covariance, predicted_position = map(
    _operation,
    ("of_block", "begin", "step", "follow", "sense", "covariance", "predicted_position"),
)
