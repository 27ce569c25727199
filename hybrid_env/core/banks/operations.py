"""The operations of the banks, selected by the type of the bank when a kernel is compiled: each is
the function of this name in the file of the bank.

    of_block(banks, block)                               the bank of one block
    motions_of(bank)                                     the modes of the user, else None

With announced switches:

    begin(bank, lane, anchor, covariance, radii, model)  start all filters of a lane from the anchor
    step(bank, first, last, measurement, model)          advance all filters of several lanes
    follow(bank, lane, hypothesis, measurement, model)   advance one filter, not its likelihood
    sense(bank, lane, first, last, block, sensors, model)  advance several filters of a lane without
                                                         a measurement, or by those of sensors
    covariance(bank, hypothesis, lane)                   of [x, vx, y, vy], upper triangle by rows
    predicted_position(bank, hypothesis, lane, model)    of one filter, with its covariance

With unknown switches:

    begin_imm(bank, block, lane, known)                  start all filters from the merged estimate
    step_imm(bank, block, first, last, radii, model)     advance all filters of several lanes
    sense_imm(bank, block, lane, radii, sensors, model)  advance them without a measurement, or by
                                                         those of sensors

Calls with the same types share one compiled function: the kernel gives unsigned indices and a
`FilterModel`. numba has no public name for the class of a named tuple in compiled code:
`instance_class` of its type is used here alone.
"""

from typing import Any

from numba.extending import overload

from hybrid_env.core.banks import anchor_aware, dense, dense_imm, imm, published
from hybrid_env.core.compilation import OPTIONS

FILES: dict[type, Any] = {
    published.PublishedBank: published,
    anchor_aware.AnchorAwareBank: anchor_aware,
    dense.DenseBank: dense,
    imm.ImmBank: imm,
    dense_imm.DenseImmBank: dense_imm,
}
"""The file of each bank."""


def _operation(name: str) -> Any:
    """Return an operation for compiled code."""

    def operation(bank: Any, *arguments: Any) -> Any:
        raise NotImplementedError("compiled code only")

    # Not strict: the names of the arguments may differ.
    @overload(operation, jit_options=OPTIONS, strict=False)
    def select(bank, *arguments):  # type: ignore[no-untyped-def]
        return getattr(FILES[bank.instance_class], name)

    return operation


of_block, motions_of, begin, step, follow, sense, covariance, predicted_position = map(
    _operation,
    (
        "of_block",
        "motions_of",
        "begin",
        "step",
        "follow",
        "sense",
        "covariance",
        "predicted_position",
    ),
)
begin_imm, step_imm, sense_imm = map(
    _operation,
    ("begin_imm", "step_imm", "sense_imm"),
)
