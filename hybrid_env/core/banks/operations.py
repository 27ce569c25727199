"""The operations of the banks, selected by the type of the bank when a kernel is compiled: each is
the function of this name in the file of the bank.

    bank_of(bank class, setting, b)                      the bank of block b
    covariance(bank, hypothesis, lane)                   of [x, vx, y, vy], upper triangle by rows

With announced switches:

    begin(bank, lane, anchor, covariance, radii, model)  start all filters of a lane from the anchor
    step(bank, lowest, stop, first, last, measured, sensors, model)  advance filters of some lanes
    predicted_position(bank, hypothesis, lane, model)    of one filter, with its covariance

With unknown switches:

    begin_imm(bank, block, lane, known)                  start all filters from the merged estimate
    step_imm(bank, block, first, last, radii, sensors, model)  advance all filters of some lanes

Calls with the same types share one compiled function: the kernel gives unsigned indices and a
`FilterModel`. numba has no public name for the class of a named tuple in compiled code:
`instance_class` of its type is used here alone.
"""

from typing import Any

from hybrid_env.core.banks import anchor_aware, imm, published
from hybrid_env.core.compilation import selected
from hybrid_env.core.memory import (
    AnchorAwareBank,
    DenseBank,
    DenseImmBank,
    ImmBank,
    PublishedBank,
    reader,
)

FILES: dict[type, Any] = {
    PublishedBank: published,
    AnchorAwareBank: anchor_aware,
    DenseBank: anchor_aware,
    ImmBank: imm,
    DenseImmBank: imm,
}
"""The file of each bank."""


def _of_file(name: str) -> Any:
    """Return the operation of this name in the file of each bank."""
    return selected(lambda bank: getattr(FILES[bank.instance_class], name))


bank_of = selected(lambda bank: reader(bank.instance_class))
begin, step, begin_imm, step_imm = map(_of_file, ("begin", "step", "begin_imm", "step_imm"))
covariance, predicted_position = map(_of_file, ("covariance", "predicted_position"))
