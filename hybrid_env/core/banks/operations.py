"""The operations of the banks, selected by the type of the bank when a kernel is compiled: each is
the function of this name in the file of the bank.

    bank_of(bank class, setting, b)                      the bank of block b

With announced switches:

    begin(bank, lane, anchor, covariance, radii, model)  start all filters of a lane from the anchor
    step(bank, lowest, stop, first, last, measurement, model)  advance filters of several lanes
    sense(bank, lane, lowest, stop, block, sensors, model)  advance filters of a lane without a
                                                         measurement, or by those of sensors
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

from collections.abc import Callable
from typing import Any

from numba.extending import overload

from hybrid_env.core.banks import anchor_aware, dense, dense_imm, imm, published
from hybrid_env.core.compilation import OPTIONS
from hybrid_env.core.memory import reader

FILES: dict[type, Any] = {
    published.PublishedBank: published,
    anchor_aware.AnchorAwareBank: anchor_aware,
    dense.DenseBank: dense,
    imm.ImmBank: imm,
    dense_imm.DenseImmBank: dense_imm,
}
"""The file of each bank."""
READERS = {bank: reader(bank) for bank in FILES}


def _operation(choose: Callable[[type], Any]) -> Any:
    """Return an operation for compiled code; choose: its function by the class of a bank."""

    def operation(bank: Any, *arguments: Any) -> Any:
        raise NotImplementedError("compiled code only")

    # Not strict: the names of the arguments may differ.
    @overload(operation, jit_options=OPTIONS, strict=False)
    def select(bank, *arguments):  # type: ignore[no-untyped-def]
        return choose(bank.instance_class)

    return operation


def _of_file(name: str) -> Any:
    """Return the operation of this name in the file of each bank."""
    return _operation(lambda bank: getattr(FILES[bank], name))


bank_of = _operation(READERS.__getitem__)
begin, step, sense = map(_of_file, ("begin", "step", "sense"))
covariance, predicted_position = map(_of_file, ("covariance", "predicted_position"))
begin_imm, step_imm, sense_imm = map(_of_file, ("begin_imm", "step_imm", "sense_imm"))
