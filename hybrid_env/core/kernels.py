"""The compiled entry points of the kernel, two for each bank. All other options are read at run
time. On a live sensor the measurement comes from the caller; all else is computed by the same
functions, so that the same measurements give the same rows; `irregular` is True in the parameters,
because any measurement may be missing.
"""

from typing import Any

import numpy as np

from hybrid_env.core import kernel, quickest_kernel
from hybrid_env.core.banks import operations
from hybrid_env.core.banks.anchor_aware import aware_banks
from hybrid_env.core.banks.bank import likeliest_of_type
from hybrid_env.core.banks.imm import begin_imm, imm_banks, imm_of_block, step_imm_irregular
from hybrid_env.core.banks.published import published_banks
from hybrid_env.core.compilation import compiled, internal
from hybrid_env.core.kernel import (
    HAS_DECISION,
    begin_bank,
    chosen_mode,
    counted_action,
    follow_irregular,
    set_anchor,
    step_irregular,
)
from hybrid_env.core.memory import (
    LANES,
    PARAMETERS,
    AnchorAwareBank,
    ImmBank,
    PublishedBank,
    array_at,
    arrays_of,
    state_of,
    write_lane,
)
from hybrid_env.core.observation_row import (
    compare_hypotheses,
    compare_types,
    mask_declarations,
    write_quickest_row,
    write_segment,
    write_tick,
)
from hybrid_env.core.quickest_kernel import record_statement

# Commands: of the environments the first two, on a live sensor the others.
STEP, RESET, MEASURE, BEGIN = range(4)

# Range of lanes; unsigned as in the other kernels.
FIRST, LAST = np.uint64(0), np.uint64(1)


@internal
def advance_live(begins: bool, banks: Any, arrays: Any, setting: Any) -> int:
    """Begin a segment, process a measurement, or declare a mode, on the first lane of the first
    block. With `begins` the last segment ends, and the bank starts from its estimate; the first
    one, whose `segment` is -1, from that of the block. Action 0 advances the bank by the
    `measurement`, and writes the observation until a mode is declared; i + 1 declares mode i, once
    the mask allows it. Then `estimate` and `covariance` are those of the last decided mode, or
    merged.
    """
    block = arrays.blocks[0]
    bank = operations.bank_of_block(banks, 0)
    if begins:
        if block.segment[0] >= 0:
            if not arrays.decision_flags[HAS_DECISION, 0]:
                block.active_mode[0] = chosen_mode(block, 0, bank, 0, setting)
            set_anchor(block, 0, bank, block.active_mode[0], setting.merged)
        block.segment[0] += 1
        arrays.decision_flags[HAS_DECISION, 0] = False
        write_lane(block.anchor, 0, state_of(block.estimate, 0))
        begin_bank(block, 0, bank, arrays.radii, setting)
        return 0
    if arrays.actions[0] > 0:
        action = counted_action(arrays, 0)
        if action == 0:
            return 0
        block.active_mode[0] = chosen_mode(block, 0, bank, action, setting)
        arrays.decision_flags[HAS_DECISION, 0] = True
        set_anchor(block, 0, bank, block.active_mode[0], setting.merged)
        return 0
    decided = arrays.decision_flags[HAS_DECISION, 0]
    block.tick[0] += 1
    block.length[0] = max(block.length[0], block.tick[0])
    if decided and not (setting.merged or setting.refined):
        follow_irregular(bank, 0, block.active_mode[0], block, arrays.sensors, setting)
    else:
        step_irregular(bank, FIRST, LAST, block, arrays.sensors, setting)
    if decided and setting.refined:
        block.active_mode[0] = likeliest_of_type(bank.hypotheses, 0, block.active_mode[0])
    if not decided:
        scratch, row = arrays.scratch[0], arrays.observations[0]
        compare_hypotheses(scratch, bank.hypotheses, FIRST, LAST)
        if not setting.exact:
            compare_types(scratch, bank.hypotheses, FIRST, LAST)
        mask_declarations(arrays.action_mask[0], scratch, 0, setting)
        if block.tick[0] == 1:
            write_segment(row, block, 0, arrays.radii, setting)
        write_tick(row, block, 0, scratch, bank, setting)
    set_anchor(block, 0, bank, block.active_mode[0], setting.merged)
    return 0


@internal
def advance_live_quickest(begins: bool, banks: Any, arrays: Any, setting: Any) -> int:
    """Begin tracks, or process statements and measurements, with unknown switch moments. With
    `begins` every filter starts from `estimate` and `covariance` of its track; the action is the
    mode before the first tick, -1 if it is not known. Otherwise it is the statement of the last
    tick.
    """
    for b in range(setting.first_block, setting.last_block):
        block = arrays.blocks[b]
        bank = imm_of_block(banks, b)
        lanes = min(LANES, setting.tracks - b * LANES)
        for lane in range(lanes):
            stated = arrays.actions[b * LANES + lane]
            if begins:
                block.time[lane], block.stated_mode[lane], block.stated_ticks[lane] = 0, 0, 0
                begin_imm(bank, block, lane, stated)
            elif block.time[lane] > 0:
                record_statement(block, lane, stated)
        if begins:
            continue
        step_imm_irregular(bank, block, FIRST, np.uint64(lanes), arrays, setting)
        for lane in range(lanes):
            block.time[lane] += 1
            write_quickest_row(arrays.observations[b * LANES + lane], block, lane, bank, setting)
    return 0


@compiled
def advance_published(address: int, command: int) -> int:
    """Step every track, or with `RESET` begin a new episode on every track whose action is not 0. A
    terminated track begins its next episode; its last observation is the one on which the last
    decision was made. The address is that of a record `PARAMETERS`, whose arrays must exist during
    the call. Returns `DECIDED` if any track made a decision, plus `TERMINATED` if any terminated;
    or, if the action of track i is outside the space, -1 - i, and no track is stepped.
    """
    setting = array_at(address, (1,), PARAMETERS)[0]
    return kernel.advance(command == RESET, published_banks(setting), arrays_of(setting), setting)


@compiled
def advance_aware(address: int, command: int) -> int:
    """Like `advance_published`, with the anchor-aware bank."""
    setting = array_at(address, (1,), PARAMETERS)[0]
    return kernel.advance(command == RESET, aware_banks(setting), arrays_of(setting), setting)


@compiled
def advance_quickest(address: int, command: int) -> int:
    """Like `advance_published`, with unknown switch moments; a statement is not an event."""
    setting = array_at(address, (1,), PARAMETERS)[0]
    return quickest_kernel.advance(
        command == RESET,
        imm_banks(setting),
        arrays_of(setting),
        setting,
    )


@compiled
def live_published(address: int, command: int) -> int:
    """Advance a track on a live sensor by `MEASURE` or `BEGIN`, see `advance_live`. Returns 0."""
    setting = array_at(address, (1,), PARAMETERS)[0]
    return advance_live(command == BEGIN, published_banks(setting), arrays_of(setting), setting)


@compiled
def live_aware(address: int, command: int) -> int:
    """Like `live_published`, with the anchor-aware bank."""
    setting = array_at(address, (1,), PARAMETERS)[0]
    return advance_live(command == BEGIN, aware_banks(setting), arrays_of(setting), setting)


@compiled
def live_quickest(address: int, command: int) -> int:
    """Like `live_published`, with unknown switch moments, see `advance_live_quickest`."""
    setting = array_at(address, (1,), PARAMETERS)[0]
    return advance_live_quickest(command == BEGIN, imm_banks(setting), arrays_of(setting), setting)


KERNELS: dict[type, Any] = {
    PublishedBank: advance_published,
    AnchorAwareBank: advance_aware,
    ImmBank: advance_quickest,
}
"""The entry point of each bank."""

LIVE_KERNELS: dict[type, Any] = {
    PublishedBank: live_published,
    AnchorAwareBank: live_aware,
    ImmBank: live_quickest,
}
"""The entry point of each bank on a live sensor."""
