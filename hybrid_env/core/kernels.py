"""The compiled entry points of the kernel, three for each bank: without rare options, with all, and
on a live sensor; a bank of modes of the user has all options in the first. All other options are
read at run time. On a live sensor the measurement comes from the caller; all else is computed by
the same functions, so that the same measurements give the same rows; `irregular` is True in the
parameters, because any measurement may be missing.
"""

from typing import Any

from hybrid_env.core import announced, kernel, unknown
from hybrid_env.core.banks import anchor_aware, dense, dense_imm, imm, published
from hybrid_env.core.compilation import compiled
from hybrid_env.core.memory import (
    AnchorAwareBank,
    DenseBank,
    DenseImmBank,
    ImmBank,
    PublishedBank,
    parameters_at,
    reader,
)

# Commands: of the environments the first two, on a live sensor the others.
STEP, RESET, MEASURE, BEGIN = range(4)

published_banks, aware_banks, imm_banks = map(reader, (PublishedBank, AnchorAwareBank, ImmBank))
dense_banks, dense_imm_banks = map(reader, (DenseBank, DenseImmBank))


@compiled
def advance_published(address: int, command: int) -> int:
    """Step every track, or with `RESET` begin a new episode on every track whose action is not 0. A
    terminated track begins its next episode; its last observation is the one on which the last
    decision was made. The address is that of a record `PARAMETERS`, whose arrays must exist during
    the call. Returns `DECIDED` if any track made a decision, plus `TERMINATED` if any terminated;
    or, if the action of track i is outside the space, -1 - i, and no track is stepped.
    """
    setting = parameters_at(address)
    banks = published_banks(setting)
    return kernel.advance(
        command == RESET,
        announced.prepare_lane,
        announced.tick,
        published.of_block,
        banks,
        setting,
    )


@compiled
def advance_aware(address: int, command: int) -> int:
    """Like `advance_published`, with the anchor-aware bank."""
    setting = parameters_at(address)
    banks = aware_banks(setting)
    return kernel.advance(
        command == RESET,
        announced.prepare_lane,
        announced.tick,
        anchor_aware.of_block,
        banks,
        setting,
    )


@compiled
def advance_quickest(address: int, command: int) -> int:
    """Like `advance_published`, with unknown switches; a statement is not an event."""
    setting = parameters_at(address)
    banks = imm_banks(setting)
    return kernel.advance(
        command == RESET,
        unknown.prepare_lane,
        unknown.tick,
        imm.of_block,
        banks,
        setting,
    )


@compiled
def advance_published_rare(address: int, command: int) -> int:
    """Like `advance_published`, with all options."""
    setting = parameters_at(address)
    banks = published_banks(setting)
    return kernel.advance(
        command == RESET,
        announced.prepare_lane,
        announced.tick,
        published.of_block,
        banks,
        setting,
        True,
    )


@compiled
def advance_aware_rare(address: int, command: int) -> int:
    """Like `advance_aware`, with all options."""
    setting = parameters_at(address)
    banks = aware_banks(setting)
    return kernel.advance(
        command == RESET,
        announced.prepare_lane,
        announced.tick,
        anchor_aware.of_block,
        banks,
        setting,
        True,
    )


@compiled
def advance_quickest_rare(address: int, command: int) -> int:
    """Like `advance_quickest`, with all options."""
    setting = parameters_at(address)
    banks = imm_banks(setting)
    return kernel.advance(
        command == RESET,
        unknown.prepare_lane,
        unknown.tick,
        imm.of_block,
        banks,
        setting,
        True,
    )


@compiled
def advance_dense(address: int, command: int) -> int:
    """Like `advance_published`, with modes of the user and all options."""
    setting = parameters_at(address)
    banks = dense_banks(setting)
    return kernel.advance(
        command == RESET,
        announced.prepare_lane,
        announced.tick,
        dense.of_block,
        banks,
        setting,
        True,
    )


@compiled
def advance_dense_quickest(address: int, command: int) -> int:
    """Like `advance_quickest`, with modes of the user and all options."""
    setting = parameters_at(address)
    banks = dense_imm_banks(setting)
    return kernel.advance(
        command == RESET,
        unknown.prepare_lane,
        unknown.tick,
        dense_imm.of_block,
        banks,
        setting,
        True,
    )


@compiled
def live_published(address: int, command: int) -> int:
    """Advance a track on a live sensor by `MEASURE` or `BEGIN`. Returns 0."""
    setting = parameters_at(address)
    bank = published.of_block(published_banks(setting), 0)
    return announced.advance_live(command == BEGIN, bank, setting)


@compiled
def live_aware(address: int, command: int) -> int:
    """Like `live_published`, with the anchor-aware bank."""
    setting = parameters_at(address)
    bank = anchor_aware.of_block(aware_banks(setting), 0)
    return announced.advance_live(command == BEGIN, bank, setting)


@compiled
def live_quickest(address: int, command: int) -> int:
    """Like `live_published`, for tracks with unknown switch moments."""
    setting = parameters_at(address)
    return unknown.advance_live(command == BEGIN, imm_banks(setting), setting)


@compiled
def live_dense(address: int, command: int) -> int:
    """Like `live_published`, with modes of the user."""
    setting = parameters_at(address)
    bank = dense.of_block(dense_banks(setting), 0)
    return announced.advance_live(command == BEGIN, bank, setting)


@compiled
def live_dense_quickest(address: int, command: int) -> int:
    """Like `live_quickest`, with modes of the user."""
    setting = parameters_at(address)
    return unknown.advance_live(command == BEGIN, dense_imm_banks(setting), setting)


def entry_point(bank: type, parameters: Any, live: bool) -> Any:
    """Return the compiled function that advances tracks with these parameters, a record
    `PARAMETERS`. The code of rare options takes half the time of a compilation.
    """
    plain, with_rare, on_sensor = {
        PublishedBank: (advance_published, advance_published_rare, live_published),
        AnchorAwareBank: (advance_aware, advance_aware_rare, live_aware),
        ImmBank: (advance_quickest, advance_quickest_rare, live_quickest),
        DenseBank: (advance_dense, advance_dense, live_dense),
        DenseImmBank: (advance_dense_quickest, advance_dense_quickest, live_dense_quickest),
    }[bank]
    rare = ["irregular", "missed", "noise_law", "freedom", "observation", "bank_rows"]
    rare += ["recalculated", "order_rows", "drawn_modes", "drawn_laws"]
    if live:
        return on_sensor
    return with_rare if any(parameters[name] for name in rare) else plain
