"""The compiled entry points of the kernel, one for each bank. All other options are read at run time."""

from typing import Any

from hybrid_env.core import kernel, quickest_kernel
from hybrid_env.core.banks.anchor_aware import AnchorAwareBank, aware_banks
from hybrid_env.core.banks.imm import ImmBank, imm_banks
from hybrid_env.core.banks.published import PublishedBank, published_banks
from hybrid_env.core.compilation import compiled
from hybrid_env.core.live import advance_live, advance_live_quickest
from hybrid_env.core.memory import array_at
from hybrid_env.core.state import PARAMETERS, arrays_of

STEP, RESET, MEASURE, BEGIN = range(4)
"""Commands: of the environments the first two, on a live sensor the others (see `live`)."""


@compiled
def advance_published(address: int, command: int) -> int:
    """Step every track, or with `RESET` begin a new episode on every track whose action is not 0.

    In a step, a terminated track begins its next episode. The observation of a track that terminates is not
    changed: it is the one on which the last decision was made.

    Args:
        address: address of a record `PARAMETERS`, whose arrays must exist during the call. Only its
            blocks first_block .. last_block - 1 are stepped, so that threads can share the tracks.
        command: what to do.

    Returns:
        `DECIDED` if any track made a decision, plus `TERMINATED` if any terminated. If the action of track i
        is outside the space, -1 - i; then no track is stepped. On a live sensor 0.
    """
    setting = array_at(address, (1,), PARAMETERS)[0]
    banks, arrays = published_banks(setting), arrays_of(setting)
    if command >= MEASURE:
        return advance_live(command == BEGIN, banks, arrays, setting)
    return kernel.advance(command == RESET, banks, arrays, setting)


@compiled
def advance_aware(address: int, command: int) -> int:
    """Like `advance_published`, with the anchor-aware bank."""
    setting = array_at(address, (1,), PARAMETERS)[0]
    banks, arrays = aware_banks(setting), arrays_of(setting)
    if command >= MEASURE:
        return advance_live(command == BEGIN, banks, arrays, setting)
    return kernel.advance(command == RESET, banks, arrays, setting)


@compiled
def advance_quickest(address: int, command: int) -> int:
    """Like `advance_published`, with unknown switch moments; a statement is not an event."""
    setting = array_at(address, (1,), PARAMETERS)[0]
    banks, arrays = imm_banks(setting), arrays_of(setting)
    if command >= MEASURE:
        return advance_live_quickest(command == BEGIN, banks, arrays, setting)
    return quickest_kernel.advance(command == RESET, banks, arrays, setting)


KERNELS: dict[type, Any] = {
    PublishedBank: advance_published,
    AnchorAwareBank: advance_aware,
    ImmBank: advance_quickest,
}
"""The entry point of each bank."""
